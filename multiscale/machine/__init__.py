"""The machine a run is on: its MPI job, its nodes' memory, its speed."""
