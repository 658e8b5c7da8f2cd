"""The file `build/compile_commands.json`, which joins those of all packages, for editors."""
