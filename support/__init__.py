"""What every package above stands on: errors, checks, MPI, threads, optional packages, whole files.

Nothing here knows of surfaces or contact.
"""
