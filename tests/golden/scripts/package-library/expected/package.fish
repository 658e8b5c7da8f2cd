# Adds the package 'library' to the environment of the fish that sources it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
set -g _forge_prefix (builtin realpath -s -- (status filename) | string replace -r '(/[^/]*){3}$' '')

# _colcon_prepend_unique_value VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _colcon_prepend_unique_value
    set -l variable $argv[1]
    set -l entries $argv[2]
    for entry in (string split --no-empty : -- "$$variable")
        test "$entry" = "$argv[2]"; or set -a entries $entry
    end
    set -gx $variable (string join : -- $entries)
end

_colcon_prepend_unique_value CMAKE_PREFIX_PATH "$_forge_prefix"
_colcon_prepend_unique_value LD_LIBRARY_PATH "$_forge_prefix/lib"
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

set -e -g _forge_prefix
