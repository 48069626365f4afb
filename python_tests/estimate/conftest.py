"""A fit that several modules look at."""

from __future__ import annotations

import warnings

import pytest

from fit_finger import made_recording, moved_start
from tendonfmu.estimate.fitting import FitWarning, FrictionFit


@pytest.fixture(scope="session")
def fit() -> FrictionFit:
    """40 s, started up to a fifth off, a fifth of the time held out; all tendons alike: 25 unknowns, 70 numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(moved_start(), share=["tendons"], kinematics=3, tolerance=1e-3, holdout=0.2)
        return fit.fit(made_recording(duration=40.0), compare=made_recording(seed=5))
