"""Patch laws: pressure of a patch over its local approach, tabulated, refined, stored."""
