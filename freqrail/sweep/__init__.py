"""A sweep: what is computed, in which parts, kept in a journal, here or on a cluster."""
