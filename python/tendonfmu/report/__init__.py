"""Pages, figures and texts of every command. Computes only what is needed to show results.

- `*_text`: sentences and table rows, for terminal, page and notebook
- `*_figures`: sheets of panels, ready to be drawn
- `*_page`, `*_files`: pages and folders of files; `page` renders their templates
- `numbers`: how numbers are written
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import detect_text, diagnosis_page, diagnosis_text, excite_text, fit_page, fit_text
    from .calibration_figures import MotionShown, PushShown, motion_sheet, push_sheet, pushes_sheet
    from .detect_figures import score_sheets, tail_sheet, write_score_figures, write_tune_figures
    from .diagnosis_figures import diagnosis_sheets
    from .diagnosis_files import REPORT, build_report, check_folder, write_diagnosis
    from .diagnosis_text import confusion_sentence, error_sentence, gain_text, left_sentence, names_of, unit_of
    from .diagnosis_types import CauseEntry, DiagnosisReport
    from .fit_figures import torque_sheets
    from .fit_laws import law_sheets
    from .fit_page import write_fit_page
    from .fit_text import ResidualTable, residual_tables
    from .history import headline, history_report, rows_of_lines, trend_sentence, write_history
    from .marked_finger import friction_figure
    from .numbers import Row, Table, capital, column, html_of, percent, rms, rounded, together
    from .page import Tile, make_folder, render, write_figures
    from .rerun_recording import check_rerun, write_rerun
    from .run_page import check_page, run_report, run_sheets, write_run_page

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
