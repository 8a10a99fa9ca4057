"""Refine the published coefficients of composition schemes by Newton's method and write them to sixty digits.

    python scripts/build_schemes.py > orbits/tableaux/published.py

If a scheme has free parameters, Newton's correction of least norm is used, which keeps the authors' optimization. The
correction is printed to the error stream: it must be of the size of the last published digit.
"""

import sys

import mpmath
from mpmath import mpf

from orbits.tableaux.conditions import composition_defects, nystrom_defects

YOSHIDA = "Yoshida (1990), Phys. Lett. A 150, 262"
KAHAN_LI = "Kahan & Li (1997), Math. Comp. 66, 1089"
SOFRONIOU = "Sofroniou & Spaletta (2005), Optim. Methods Softw. 20, 597"
SUZUKI_UMENO = "Suzuki & Umeno (1993); McLachlan (1995), SIAM J. Sci. Comput. 16, 151"
TSITOURAS = "Tsitouras (1999), Celest. Mech. Dyn. Astron. 74, 223"
BLANES = "Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313"

# (order, name): (source, gammas of the first half with the middle one, as published)
COMPOSITIONS = {
    (6, "yoshida"): (
        YOSHIDA + ", solution A",
        "0.784513610477560 0.235573213359357 -1.17767998417887 1.315186320683906",
    ),
    (6, "kahan-li"): (
        KAHAN_LI,
        "0.39216144400731413928 0.33259913678935943860 -0.70624617255763935981 0.082213596293550800230 "
        "0.79854399093482996340",
    ),
    (6, "sofroniou-spaletta-11"): (
        SOFRONIOU,
        "0.21375583945878254555518066964857 0.18329381407425713911385974425217 0.17692819473098943794898811709929 "
        "-0.44329082681170215849622829626258 0.11728560432865935385403585669136 0.50405474843802736404832781714239",
    ),
    (6, "sofroniou-spaletta"): (
        SOFRONIOU,
        "0.13861930854051695245808013042625 0.13346562851074760407046858832209 0.13070531011449225190542755785015 "
        "0.12961893756907034772505366537091 -0.35000324893920896516170830911323 0.11805530653002387170273438954049 "
        "0.39907751534871587459988795520665",
    ),
    (8, "yoshida"): (
        YOSHIDA + ", solution D",
        "0.914844246229740 0.253693336566229 -1.44485223686048 -0.158240635368243 1.93813913762276 -1.96061023297549 "
        "0.102799849391985 1.7084530707869978",
    ),
    (8, "suzuki-umeno"): (
        SUZUKI_UMENO,
        "0.74167036435061295344822780 -0.40910082580003159399730010 0.19075471029623837995387626 "
        "-0.57386247111608226665638773 0.29906418130365592384446354 0.33462491824529818378495798 "
        "0.31529309239676659663205666 -0.79688793935291635401978884",
    ),
    (8, "kahan-li"): (
        KAHAN_LI,
        "0.13020248308889008088 0.56116298177510838456 -0.38947496264484728641 0.15884190655515560090 "
        "-0.39590389413323757734 0.18453964097831570709 0.25837438768632204729 0.29501172360931029887 "
        "-0.60550853383003451170",
    ),
    (8, "sofroniou-spaletta"): (
        SOFRONIOU,
        "0.10647728984550031823931967854896 0.10837408645835726397433410591546 0.35337821052654342419534541324080 "
        "-0.23341414023165082198780281128319 -0.24445266791528841269462171413216 0.11317848435755633314700952515599 "
        "0.11892905625000350062692972283951 0.12603912321825988140305670268365 0.12581718736176041804392391641587 "
        "0.11699135019217642180722881433533 -0.38263596012643665350944670744040",
    ),
    (10, "kahan-li"): (
        KAHAN_LI,
        "-0.48159895600253002870 0.0036303931544595926879 0.50180317558723140279 0.28298402624506254868 "
        "0.80702967895372223806 -0.026090580538592205447 -0.87286590146318071547 -0.52373568062510581643 "
        "0.44521844299952789252 0.18612289547097907887 0.23137327866438360633 -0.52191036590418628905 "
        "0.74866113714499296793 0.066736511890604057532 -0.80360324375670830316 0.91249037635867994571",
    ),
    (10, "tsitouras"): (
        TSITOURAS,
        "0.09040619368607278492161150 0.53591815953030120213784983 0.35123257547493978187517736 "
        "-0.31116802097815835426086544 -0.52556314194263510431065549 0.14447909410225247647345695 "
        "0.02983588609748235818064083 0.17786179923739805133592238 0.09826906939341637652532377 "
        "0.46179986210411860873242126 -0.33377845599881851314531820 0.07095684836524793621031152 "
        "0.23666960070126868771909819 -0.49725977950660985445028388 -0.30399616617237257346546356 "
        "0.05246957188100069574521612 0.44373380805019087955111365",
    ),
    (10, "sofroniou-spaletta"): (
        SOFRONIOU,
        "0.078795722521686419263907679337684 0.31309610341510852776481247192647 0.027918383235078066109520273275299 "
        "-0.22959284159390709415121339679655 0.13096206107716486317465685927961 -0.26973340565451071434460973222411 "
        "0.074973343155891435666137105641410 0.11199342399981020488957508073640 0.36613344954622675119314812353150 "
        "-0.39910563013603589787862981058340 0.10308739852747107731580277001372 0.41143087395589023782070411897608 "
        "-0.0048663605831352617621956593099771 -0.39203335370863990644808193642610 "
        "0.051942502962449647037182904015976 0.050665090759924496335874344156866 0.049674370639729879054568800279461 "
        "0.049317735759594537917680008339338",
    ),
}

# (order, name): (source, kicks, drifts), both up to the middle; kicks are one more than drifts in all
SPLITTINGS = {
    (4, "blanes-moan"): (
        BLANES + ", SRKN 6b",
        "0.0829844064174052 0.396309801498368 -0.0390563049223486 0.1195241940131508",
        "0.245298957184271 0.604872665711080 -0.350171622895351",
        True,
    ),
    (6, "blanes-moan-11"): (
        BLANES + ", SRKN 11b",
        "0.0414649985182624 0.198128671918067 -0.0400061921041533 0.0752539843015807 -0.0115113874206879 "
        "0.2366699247869311",
        "0.123229775946271 0.290553797799558 -0.127049212625417 -0.246331761062075 0.357208872795928 0.20477705429147",
        False,
    ),
    (6, "blanes-moan"): (
        BLANES + ", SRKN 14a",
        "0 0.09171915262446165 0.183983170005006 -0.05653436583288827 0.004914688774712854 0.143761127168358 "
        "0.328567693746804 -0.19641146648645423",
        "0.0378593198406116 0.102635633102435 -0.0258678882665587 0.314241403071447 -0.130144459517415 "
        "0.106417700369543 -0.00879424312851058 0.2073050690568954",
        False,
    ),
}


def whole(half, middle_once):
    return [*half, *reversed(half[:-1] if middle_once else half)]


def newton(defects, start):
    """Newton's method with the correction of least norm, the derivative by differences in twice the digits."""
    x = mpmath.matrix(start)
    for _ in range(9):
        f = mpmath.matrix(defects(list(x)))
        delta = mpf(10) ** -60
        J = mpmath.matrix(len(f), len(x))
        for k in range(len(x)):
            y = x.copy()
            y[k] += delta
            J[:, k] = (mpmath.matrix(defects(list(y))) - f) / delta
        # What is redundant in J has no say: the normal equations, regularized far below the digits that are kept.
        damping = mpmath.eye(len(f)) * mpf(10) ** -55
        x -= J.T * mpmath.lu_solve(J * J.T + damping, f)
    return list(x), max(abs(v) for v in defects(list(x)))


def main():
    mpmath.mp.dps = 150
    print('"""Composition schemes to sixty digits, refined from the published ones; by scripts/build_schemes.py."""\n')
    print("# (order, name): source, then the steps gamma of the first half up to the middle one, as texts")
    print("COMPOSITIONS: dict[tuple[int, str], tuple[str, tuple[str, ...]]] = {")
    for (order, name), (source, digits) in COMPOSITIONS.items():
        start = [mpf(x) for x in digits.split()]
        x, left = newton(lambda half, order=order: composition_defects(whole(half, True), 2, order), start)
        tell(order, name, left, start, x)
        print(f'    ({order}, "{name}"): (\n        "{source}",\n        (')
        print("".join(f'            "{mpmath.nstr(v, 60)}",\n' for v in x), end="        ),\n    ),\n")
    print("}\n")
    print(
        "# (order, name): source, kicks and drifts from the beginning to the middle, and whether a kick is the middle"
    )
    print("SPLITTINGS: dict[tuple[int, str], tuple[str, tuple[str, ...], tuple[str, ...], bool]] = {")
    for (order, name), (source, kicks, drifts, kick_in_the_middle) in SPLITTINGS.items():
        k, d = ([mpf(x) for x in text.split()] for text in (kicks, drifts))
        fixed = int(k[0] == 0)  # a chain that begins with a drift keeps no kick before it
        n = len(k) - fixed

        def defects(x, n=n, fixed=fixed, order=order, middle=kick_in_the_middle):
            head = [mpf(0)] * fixed + list(x[:n])
            return nystrom_defects(whole(head, middle), whole(list(x[n:]), not middle), order)

        x, left = newton(defects, k[fixed:] + d)
        tell(order, name, left, k[fixed:] + d, x)
        print(f'    ({order}, "{name}"): (\n        "{source}",')
        for values in (["0"] * fixed + x[:n], x[n:]):
            texts = [v if v == "0" else mpmath.nstr(v, 60) for v in values]
            print("        (\n" + "".join(f'            "{v}",\n' for v in texts) + "        ),")
        print(f"        {kick_in_the_middle},\n    ),")
    print("}")


def tell(order, name, left, before, after):
    moved = max(abs(a - b) for a, b in zip(before, after, strict=True))
    print(order, name, "conditions", mpmath.nstr(left, 3), "moved", mpmath.nstr(moved, 3), file=sys.stderr)


if __name__ == "__main__":
    main()
