"""What all commands share: how values are typed, options as tables, the console, files written whole."""
