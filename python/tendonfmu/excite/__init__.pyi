from . import training_motion as training_motion
from .excitation import Excitation as Excitation
from .excitation import Plan as Plan
from .excitation import plan_excitation as plan_excitation
from .training_motion import ExciteResult as ExciteResult
from .training_motion import read_subject as read_subject
