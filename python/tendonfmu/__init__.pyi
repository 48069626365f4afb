from .detect import TuneWarning as TuneWarning
from .errors import InputError as InputError
from .errors import InputWarning as InputWarning
from .estimate import FitWarning as FitWarning
from .interface import Diagnosis as Diagnosis
from .interface import DiagnosisWarning as DiagnosisWarning
from .interface import FitResult as FitResult
from .interface import Runner as Runner
from .interface import RunResult as RunResult
from .interface import Sample as Sample
from .interface import ScoreResult as ScoreResult
from .interface import ScoreWarning as ScoreWarning
from .interface import TuneResult as TuneResult
from .interface import build as build
from .interface import diagnose as diagnose
from .interface import fit as fit
from .interface import run as run
from .interface import score as score
from .interface import tune as tune
from .model import Finger as Finger
from .model import read_finger as read_finger
from .recordings import Recording as Recording
from .recordings import read_recording as read_recording

__version__: str
