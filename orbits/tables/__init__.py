"""Values as tables of other packages: astropy's QTable, pandas, xarray, and HTML for notebooks.

Nothing here knows a System or a run: what is to be shown is handed over as named arrays with units (`Labelled`).
"""

from orbits.tables.html import MOST_ROWS, html_pairs, html_table
from orbits.tables.labelled import Labelled, Variable
from orbits.tables.tabular import Tabular

__all__ = ["MOST_ROWS", "Labelled", "Tabular", "Variable", "html_pairs", "html_table"]
