"""The container of SPZ files of Gaussians."""
