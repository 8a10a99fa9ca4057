"""Lines in the Minor Planet Center's format: published ones, and a plain formatter that makes others."""

from __future__ import annotations

from dataclasses import dataclass

# As the Minor Planet Center published them, for the epoch 2025 November 21.
CERES = (
    "00001    3.34  0.15 K25BL 231.53974   73.29974   80.24964   10.58789  0.0795764  0.21429712   2.7656157  0"
    " MPO980521  7297 126 1801-2026 0.83 M-v 30k Veres      4000      (1) Ceres              20260103"
)
VESTA = (
    "00004    3.25  0.15 K25BL  26.80969  151.53711  103.70232    7.14406  0.0901676  0.27158812   2.3615413  0"
    " MPO964264  7603 112 1821-2025 0.69 M-p 18k MPCORBFIT  4000      (4) Vesta              20250624"
)
# And for 2024 March 31.
PALLAS_2024 = (
    "00002    4.12  0.15 K243V  83.32723  310.88725  172.91472   34.92284  0.2303399  0.21373952   2.7704235  0"
    " E2024-DC2  8902 123 1804-2024 0.59 M-c 28k MPCLINUX   0000      (2) Pallas             20240223"
)
HEADER = (
    "MINOR PLANET CENTER ORBIT DATABASE (MPCORB)\n\nThis file contains published orbital elements.\n\n"
    "Des'n     H     G   Epoch     M        Peri.      Node       Incl.       e            n           a      "
    "  Reference #Obs #Opp    Arc    rms  Perts   Computer\n\n" + "-" * 160 + "\n"
)

BASE_62 = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
ORDER = "ABCDEFGHJKLMNOPQRSTUVWXYZ"


def packed_number(number: int) -> str:
    if number < 620_000:
        return f"{BASE_62[number // 10_000]}{number % 10_000:04d}"
    rest, digits = number - 620_000, ""
    for _ in range(4):
        rest, digit = divmod(rest, 62)
        digits = BASE_62[digit] + digits
    return f"~{digits}"


def provisional(year: int, half: str, count: int) -> tuple[str, str]:
    """(packed, readable) of the count-th discovery, from 0, of a half-month."""
    cycle, order = divmod(count, 25)
    shown = str(year) if year >= 1925 else f"A{year % 1000:03d}"
    readable = f"{shown} {half}{ORDER[order]}{cycle or ''}"
    if count >= 15_500:
        rest, digits = count - 15_500, ""
        for _ in range(4):
            rest, digit = divmod(rest, 62)
            digits = BASE_62[digit] + digits
        return f"_{BASE_62[year - 2000]}{half}{digits}", readable
    century = {18: "I", 19: "J", 20: "K"}[year // 100]
    return f"{century}{year % 100:02d}{half}{BASE_62[cycle // 10]}{cycle % 10}{ORDER[order]}", readable


@dataclass(frozen=True)
class Line:
    """What is printed, as text without blanks, so that its value is float() of it."""

    packed: str
    readable: str
    epoch: str
    M: str
    omega: str
    Omega: str
    inc: str
    e: str
    a: str
    H: str = "12.34"

    def __str__(self) -> str:
        n = 0.9856076686014251 * float(self.a) ** -1.5
        text = (
            f"{self.packed:<7} {self.H:>5}  0.15 {self.epoch} {self.M:>9}  {self.omega:>9}  {self.Omega:>9}"
            f"  {self.inc:>9}  {self.e:>9} {n:11.8f} {self.a:>11}  0 MPO980521  7297 126 1801-2026 0.83 M-v 30k"
            f" Veres      4000 {self.readable:<28}20260103"
        )
        assert len(text) == 202
        return text
