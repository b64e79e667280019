"""The projector of a cone beam: tables of lines, compiled kernels, and the same in plain torch operations."""
