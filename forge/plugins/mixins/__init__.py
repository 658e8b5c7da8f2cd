"""`forge mixin`: lists and shows mixins, and fetches those of repositories, as colcon-mixin does."""
