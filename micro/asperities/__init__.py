"""The asperity models of Waddad et al. 2016: every summit a Hertz contact."""
