from .finger_import import ImportSettings as ImportSettings
from .finger_import import import_finger as import_finger
from .number_export import export_numbers as export_numbers
