"""The atlas: which models suit which problem, found by running all of them on the same six small problems."""
