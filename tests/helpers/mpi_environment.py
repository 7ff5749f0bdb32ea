"""Environment of the commands that tests start under MPI."""

MPI_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    # containers run tests as root, and with fewer cores than ranks
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_btl": "^tcp",
}
BESIDE_OTHERS = MPI_ENVIRONMENT | {"OMPI_MCA_mpi_yield_when_idle": "1"}
"""The same where other ranks share the cores: those that wait leave them to who works."""
