# Adds the package 'library' to the environment of the PowerShell that runs it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# The folder of this tree, wherever it was moved and from wherever this script is run.
$_forge_prefix = Split-Path -Parent (Split-Path -Parent $PSScriptRoot)

# _colcon_prepend_unique_value VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _colcon_prepend_unique_value([string] $Variable, [string] $Entry) {
  $held = "$([Environment]::GetEnvironmentVariable($Variable))".Split(':')
  $kept = @($held | Where-Object { $_ -and $_ -cne $Entry })
  [Environment]::SetEnvironmentVariable($Variable, (@($Entry) + $kept) -join ':')
}

_colcon_prepend_unique_value CMAKE_PREFIX_PATH "$_forge_prefix"
_colcon_prepend_unique_value LD_LIBRARY_PATH "$_forge_prefix/lib"
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

Remove-Variable _forge_prefix
