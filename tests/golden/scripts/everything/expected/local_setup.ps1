# Adds the packages of this folder to the environment of the PowerShell that runs it.
# 'setup.ps1' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is run.
$_forge_root = $PSScriptRoot

$_forge_gone = @()
# Packages that were removed since then are left out.
foreach ($_forge_name in @(
    'library'
    'odd'
    'programs'
  )) {
  if (-not (Test-Path -LiteralPath "$_forge_root/$_forge_name/share/colcon-core/packages/$_forge_name")) {
    $_forge_gone += $_forge_name
  }
}

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

# _forge_append VARIABLE ENTRIES: put the selected entries after those that the variable holds.
function _forge_append([string] $Variable, [string[]] $Entries) {
  $new = @(_forge_select $Variable $Entries)
  if ($new.Count) {
    $held = [Environment]::GetEnvironmentVariable($Variable)
    if ($held) { $new = @($held) + $new }
    [Environment]::SetEnvironmentVariable($Variable, $new -join ':')
  }
}

# _forge_present SCRIPT: tell if the script can be run; warn if not, for all else works without.
function _forge_present([string] $Script) {
  if (-not (Test-Path -LiteralPath $Script -PathType Leaf)) {
    [Console]::Error.WriteLine("warning: '$Script' is not there any more and is left out")
    return $false
  }
  if ($env:COLCON_TRACE) {
    [Console]::Out.WriteLine("# . `"$Script`"")
  }
  return $true
}

# _forge_sh SCRIPT: let sh source a script that is not for PowerShell, and take over what that changes
# in the environment. Functions and aliases stay in sh.
function _forge_sh([string] $Script) {
  $program = @'
# Tells the environment before and after sourcing "$1", each variable followed by NUL, and another NUL
# between the two. What the script prints goes to stderr.
exec 3>&1 1>&2

# What ament promises to the hooks of its packages.
ament_append_value() {
  eval "export $1=\"\${$1:+\$$1:}\$2\""
}

ament_append_unique_value() {
  eval "_forge_held=:\${$1-}:"
  case $_forge_held in
    *":$2:"*) ;;
    *) ament_append_value "$1" "$2" ;;
  esac
}

ament_prepend_unique_value() {
  eval "_forge_held=:\${$1-}:"
  case $_forge_held in
    *":$2:"*) ;;
    *) eval "export $1=\"\$2\${$1:+:\$$1}\"" ;;
  esac
}

# _colcon_prepend_unique_value VARIABLE ENTRY: make the entry the first one, and drop empty ones.
_colcon_prepend_unique_value() {
  eval "_forge_held=:\${$1-}:"
  while :; do
    case $_forge_held in
      *":$2:"*) _forge_held=${_forge_held%%":$2:"*}:${_forge_held#*":$2:"} ;;
      *::*) _forge_held=${_forge_held%%::*}:${_forge_held#*::} ;;
      *) break ;;
    esac
  done
  _forge_held=$2$_forge_held
  export "$1=${_forge_held%:}"
  unset _forge_held
}

/usr/bin/env -0 >&3
printf "\000" >&3
. "$1" </dev/null || :
exec /usr/bin/env -0 >&3
'@
  $before = [Collections.Hashtable]::new([StringComparer]::Ordinal)
  $after = [Collections.Hashtable]::new([StringComparer]::Ordinal)
  $side = $before
  foreach ($pair in (($program | & /bin/sh -s -- $Script) -join "`n").Split([char] 0)) {
    if (-not $pair) {
      $side = $after
    } elseif ($pair -cmatch '^(?!(_|SHLVL|PWD|OLDPWD|(COLCON|AMENT)_CURRENT_PREFIX)=)([A-Za-z_]\w*)=') {
      $side[$Matches[3]] = $pair.Substring($Matches[0].Length)
    }
  }
  if (-not $after.Count) {
    [Console]::Error.WriteLine("warning: '$Script' ends the shell and is left out")
    return
  }
  foreach ($name in $before.Keys) {
    if (-not $after.ContainsKey($name)) { [Environment]::SetEnvironmentVariable($name, $null) }
  }
  foreach ($name in $after.Keys) {
    if ($before[$name] -cne $after[$name]) { [Environment]::SetEnvironmentVariable($name, $after[$name]) }
  }
}

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "library"

_forge_prepend LD_LIBRARY_PATH "library/lib"

_forge_prepend AMENT_PREFIX_PATH "library"

if (Test-Path -LiteralPath "$_forge_root/odd/share/colcon-core/packages/odd") {
  _forge_prepend PATH "/opt/odd `$HOME"
}

_forge_append PATH "odd/last"

if (Test-Path -LiteralPath "$_forge_root/odd/share/colcon-core/packages/odd") {
  $env:ODD_MODEL = "the `"great`" one"
}

if ((Test-Path -LiteralPath "$_forge_root/odd/share/colcon-core/packages/odd") -and -not $env:ODD_HOME) {
  $env:ODD_HOME = "$_forge_root/odd/share/odd"
}

# A hook of 'odd'.
if (_forge_present "$_forge_root/odd/share/odd/hook.sh") {
  $env:COLCON_CURRENT_PREFIX = "$_forge_root/odd"
  $env:AMENT_CURRENT_PREFIX = "$_forge_root/odd"
  _forge_sh "$_forge_root/odd/share/odd/hook.sh"
  $env:COLCON_CURRENT_PREFIX = $null
  $env:AMENT_CURRENT_PREFIX = $null
}

_forge_prepend AMENT_PREFIX_PATH @(
  "programs"
  "odd"
)

_forge_prepend PATH "programs/bin"

_forge_prepend PYTHONPATH "programs/lib/python3.11/site-packages"

Remove-Item Function:_forge_select, Function:_forge_prepend, Function:_forge_first
Remove-Item Function:_forge_append
Remove-Item Function:_forge_present
Remove-Item Function:_forge_sh
Remove-Variable _forge_root, _forge_gone, _forge_name
