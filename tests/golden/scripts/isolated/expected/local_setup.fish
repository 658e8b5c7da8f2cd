# Adds the packages of this folder to the environment of the fish that sources it.
# 'setup.fish' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
set -g _forge_root (builtin realpath -s -- (status filename) | string replace -r '/[^/]*$' '')

set -g _forge_gone
# Packages that were removed since then are left out.
for _forge_name in \
    library \
    programs

    if not test -e "$_forge_root/$_forge_name/share/colcon-core/packages/$_forge_name"
        set -a _forge_gone $_forge_name
    end
end

# _forge_select VARIABLE ENTRIES...: set _forge_held to what the variable holds, and _forge_new to those
# of the entries that are not among it and whose package is still there.
# Entries are paths below this folder, or one path that begins with '/'.
function _forge_select
    set -l variable $argv[1]
    set -g _forge_held
    if test -n "$$variable"
        set _forge_held (string split : -- "$$variable")
    end
    set -g _forge_new $argv[2..-1]
    if not string match -q '/*' -- $_forge_new[1]
        for name in $_forge_gone
            set _forge_new (printf '%s\n' $_forge_new | string match -v -r -- "^$name(/|\$)")
        end
        set -q _forge_new[1]; or return
        set _forge_new $_forge_root/$_forge_new
        if not string replace -q -- $_forge_root '' "$$variable"
            # Nothing of this tree is there yet.
            return
        end
    end
    set -l size (count $_forge_new)
    if test (count $_forge_held) -ge $size; and test "$_forge_new" = "$_forge_held[1..$size]"
        # Sourced before: there is nothing to add.
        set _forge_new
        return
    end
    set -l entries $_forge_new
    set _forge_new
    for entry in $entries
        contains -- $entry $_forge_held; or set -a _forge_new $entry
    end
end

# _forge_prepend VARIABLE ENTRIES...: put the selected entries before those that the variable holds.
function _forge_prepend
    _forge_select $argv
    if set -q _forge_new[1]
        set -gx $argv[1] (string join : -- $_forge_new $_forge_held)
    end
end

# _forge_first VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _forge_first
    set -l variable $argv[1]
    set -l entries $argv[2]
    for entry in (string split --no-empty : -- "$$variable")
        test "$entry" = "$argv[2]"; or set -a entries $entry
    end
    set -gx $variable (string join : -- $entries)
end

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "library"

_forge_prepend LD_LIBRARY_PATH "library/lib"

_forge_prepend AMENT_PREFIX_PATH \
    "programs" \
    "library"

_forge_prepend PATH "programs/bin"

_forge_prepend PYTHONPATH "programs/lib/python3.11/site-packages"

functions -e _forge_select _forge_prepend _forge_first
set -e -g _forge_root
set -e -g _forge_gone
set -e -g _forge_held
set -e -g _forge_new
