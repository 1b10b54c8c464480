"""Air that water traps."""
