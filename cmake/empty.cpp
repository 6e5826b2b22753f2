// A room that has no source of its own yet is an empty library.
