"""Values as tables of other packages: astropy's QTable, pandas, xarray, text for print and HTML for notebooks.

Nothing here knows a System or a run: what is to be shown is handed over as named arrays with units (`Labelled`).
"""

from orbits.export.html import MOST_ROWS, html_pairs, html_table
from orbits.export.labelled import Labelled, Variable
from orbits.export.tabular import Tabular
from orbits.export.text import headed, text_table

__all__ = ["MOST_ROWS", "Labelled", "Tabular", "Variable", "headed", "html_pairs", "html_table", "text_table"]
