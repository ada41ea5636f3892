"""Names of the axes of data sets, as HDF5 dimension scales: xarray and netCDF read them."""

from collections.abc import Sequence

import h5py
import numpy as np

from scenegen.files.content import SHA256, dataset_digest


def name_axes(group: h5py.Group, dataset: h5py.Dataset, axes: Sequence[str]) -> None:
    """Name each axis of a dataset after a scale of `group`: a dataset that counts from 0.

    Scales are made when they are first named. Raises ValueError where one name stands for axes of
    two lengths.
    """
    for axis, name, length in zip(dataset.dims, axes, dataset.shape, strict=True):
        if name not in group:
            _make_scale(group, name, length)
        if group[name].shape != (length,):
            raise ValueError(f"{dataset.name}: axis {name!r} of {length}, not {group[name].shape}")
        axis.label = name
        axis.attach_scale(group[name])


def _make_scale(group: h5py.Group, name: str, length: int) -> None:
    values = np.arange(length, dtype=np.int32)
    scale = group.create_dataset(name, data=values)
    scale.make_scale(name)
    scale.attrs[SHA256] = dataset_digest(values)
