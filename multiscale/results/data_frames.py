"""Tables and arrays of results as data frames and datasets, by packages that patchlaw can miss."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def data_frame(records: list[dict[str, Any]]) -> Any:
    """Return records as a pandas data frame, with a column for each of their keys.

    Args:
        records: The rows.

    Raises:
        ImportError: When pandas, which patchlaw does not require, is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise ImportError(
            "a data frame needs pandas (Debian: apt install python3-pandas); `records` gives the "
            "same rows without it"
        ) from error
    return DataFrame(records)


def dataset(
    values: Mapping[str, Any], coordinates: Mapping[str, Any], facts: Mapping[str, Any]
) -> Any:
    """Return arrays as an xarray dataset.

    Args:
        values: Dimensions and array of each variable, by name.
        coordinates: The same of each coordinate.
        facts: Attributes of the dataset.

    Raises:
        ImportError: When xarray, which patchlaw does not require, is not installed.
    """
    try:
        from xarray import Dataset
    except ImportError as error:
        raise ImportError(
            "a dataset needs xarray (Debian: apt install python3-xarray); the attributes of the "
            "same names are plain arrays without it"
        ) from error
    return Dataset(dict(values), coords=dict(coordinates), attrs=dict(facts))
