"""Pages, figures and texts of every command. Computes only what is needed to show results.

- `*_text`: sentences and table rows
- `*_figures`: figures ready to be drawn; `*_plots` draws them
- `*_page`, `*_files`: pages and folders of files
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import (
        diagnosis_numbers,
        diagnosis_page,
        diagnosis_report,
        diagnosis_text,
        excite_text,
        fit_page,
        fit_text,
        history_text,
        score_files,
        score_text,
        tune_files,
        tune_text,
    )
    from .diagnosis_figures import diagnosis_sheets
    from .diagnosis_files import check_folder, write_diagnosis
    from .diagnosis_numbers import unit_of
    from .diagnosis_page import cards_of
    from .diagnosis_report import REPORT
    from .diagnosis_text import Names, at_place, confusion_sentence, error_sentence, left_sentence, names_of
    from .diagnosis_waterfall import waterfall_of
    from .figure_data import CompensationFigure, JointCurves, StoryFigure, compensation_figure
    from .fit_figures import torque_sheets
    from .fit_law_figures import law_sheets
    from .fit_page import write_fit_page
    from .fit_summary import ResidualTable, residual_tables, rounded
    from .history_files import history_report, write_history
    from .page import Tile, render
    from .plots import draw_story
    from .run_page import check_page, write_run_page
    from .run_report import run_report

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
