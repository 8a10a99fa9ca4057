"""Export to tables of other packages: astropy's QTable, pandas, xarray, text for `print` and HTML for notebooks.

This package does not know systems or runs; it takes named arrays with units (`Labelled`).
"""

from orbits.export.html import MOST_ROWS, html_pairs, html_table
from orbits.export.labelled import Labelled, Variable
from orbits.export.tabled import Tabled, Valued
from orbits.export.tabular import Tabular
from orbits.export.text import headed, text_table

__all__ = [
    "MOST_ROWS",
    "Labelled",
    "Tabled",
    "Tabular",
    "Valued",
    "Variable",
    "headed",
    "html_pairs",
    "html_table",
    "text_table",
]
