"""Pages, figures and texts of every command. Computes only what is needed to show results.

- `detection`, `*_text`: sentences and table rows, for terminal, page and notebook
- `*_figures`: sheets of panels, ready to be drawn
- `*_page`, `*_files`: pages and folders of files
- `kit`: how numbers and tables are written, and templates rendered
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import detection, diagnosis_page, diagnosis_text, fit_page
    from .detection import score_sheets, tail_sheet, write_score_figures, write_tune_figures
    from .diagnosis_figures import diagnosis_sheets
    from .diagnosis_files import REPORT, build_report, check_folder, write_diagnosis
    from .diagnosis_text import left_sentence, names_of, unit_of
    from .diagnosis_types import DiagnosisReport
    from .finger_figures import MotionShown, PushShown, friction_figure, motion_sheet, push_sheet
    from .fit_figures import law_sheets, torque_sheets
    from .fit_page import residual_tables, write_fit_page
    from .history import headline, history_report, rows_of_lines, trend_sentence, write_history
    from .kit import (
        Row,
        Table,
        Tile,
        capital,
        column,
        html_of,
        percent,
        percent_interval,
        render,
        rms,
        rounded,
        together,
        write_figures,
    )
    from .run_page import check_page, run_report, run_sheets, write_run_page

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
