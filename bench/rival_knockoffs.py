"""Model-X knockoffs (Candès, Fan, Janson, Lv: "Panning for gold", JRSS B 80 (2018)) by knockpy (Spector, Janson).

Each candidate at a place is one variable: the first principal direction of its columns. Gaussian knockoffs of second
order by minimum reconstructability (MVR), the statistic is the difference of lasso coefficients. A cause is named where
it passes the threshold for a share of false ones of 10 %, the largest statistic first.

The threshold is that of the modified share (offset 0). The exact one (offset 1, "knockoff+") names nothing or at least
ten causes at 10 %, and here there is one. The method takes rows for independent draws; those of a recording are not.
"""

from __future__ import annotations

import warnings

import numpy as np

from rival_columns import MOST_CAUSES, Numbers, Plain, Trial, least_power

FALSE_SHARE = 0.1
SEED = 0


def by_knockoffs(data: Plain) -> list[Trial]:
    """Raises ModuleNotFoundError where knockpy is not installed."""
    from knockpy import KnockoffFilter
    from knockpy.knockoff_stats import data_dependent_threshhold

    owners, variables = one_variable_each(data)
    np.random.seed(SEED)  # noqa: NPY002  knockpy draws from the global generator
    knockoffs = KnockoffFilter(ksampler="gaussian", fstat="lasso", knockoff_kwargs={"method": "mvr"})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the lasso, at its smallest penalties
        knockoffs.forward(variables, data.target / data.target.std(), fdr=FALSE_SHARE)
    statistic = np.asarray(knockoffs.W)
    least = data_dependent_threshhold(statistic, fdr=FALSE_SHARE, offset=0)
    order = np.argsort(-statistic)
    return [owners[k] for k in order if statistic[k] > 0.0 and statistic[k] >= least][:MOST_CAUSES]


def one_variable_each(data: Plain) -> tuple[list[Trial], Numbers]:
    """A trial for each place of a candidate, and [R, v] the first principal direction of its columns, of rms 1."""
    power = np.einsum("rc,rc->c", data.columns, data.columns)
    shown = power > least_power(power)
    owners: list[Trial] = []
    variables: list[Numbers] = []
    for where in dict.fromkeys(trial.where for trial in data.trials):
        own = [trial for trial in data.trials if trial.where == where]
        numbers = [number for trial in own for number in trial.numbers if shown[number]]
        if not numbers:
            continue
        scaled = data.columns[:, numbers] / np.sqrt(power[numbers])
        direction = np.linalg.eigh(scaled.T @ scaled)[1][:, -1]
        variable = scaled @ direction
        owners.append(own[0])
        variables.append(variable / np.sqrt(np.mean(variable**2)))
    return owners, np.column_stack(variables)
