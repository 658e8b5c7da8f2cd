# Adds the packages of this folder to the environment of the PowerShell that runs it.
# 'setup.ps1' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is run.
$_forge_root = $PSScriptRoot

$_forge_gone = @()

# _forge_select VARIABLE ENTRIES: those of the entries that the variable does not hold and whose package
# is still there. Entries are paths below this folder, or begin with '/'.
function _forge_select([string] $Variable, [string[]] $Entries) {
  $held = [Collections.Generic.HashSet[string]]::new([StringComparer]::Ordinal)
  foreach ($entry in "$([Environment]::GetEnvironmentVariable($Variable))".Split(':')) {
    [void] $held.Add($entry)
  }
  foreach ($entry in $Entries) {
    if (-not $entry.StartsWith('/')) {
      if ($_forge_gone -ccontains $entry.Split('/')[0]) { continue }
      $entry = "$_forge_root/$entry"
    }
    if ($held.Add($entry)) { $entry }
  }
}

# _forge_prepend VARIABLE ENTRIES: put the selected entries before those that the variable holds.
function _forge_prepend([string] $Variable, [string[]] $Entries) {
  $new = @(_forge_select $Variable $Entries)
  if ($new.Count) {
    $held = [Environment]::GetEnvironmentVariable($Variable)
    if ($held) { $new += $held }
    [Environment]::SetEnvironmentVariable($Variable, $new -join ':')
  }
}

# _forge_first VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _forge_first([string] $Variable, [string] $Entry) {
  $held = "$([Environment]::GetEnvironmentVariable($Variable))".Split(':')
  $kept = @($held | Where-Object { $_ -and $_ -cne $Entry })
  [Environment]::SetEnvironmentVariable($Variable, (@($Entry) + $kept) -join ':')
}

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "$_forge_root"

_forge_prepend LD_LIBRARY_PATH "lib"

_forge_prepend AMENT_PREFIX_PATH "$_forge_root"

_forge_prepend PATH "bin"

_forge_prepend PYTHONPATH "lib/python3.11/site-packages"

Remove-Item Function:_forge_select, Function:_forge_prepend, Function:_forge_first
Remove-Variable _forge_root, _forge_gone
