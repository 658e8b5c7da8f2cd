# Makes this workspace, and those that it was built on, the environment of the PowerShell that runs it.
# 'local_setup.ps1' adds this workspace alone.
#
# Written by forge after every build.

# The folder of this tree, wherever it was moved and from wherever this script is run.
$_forge_setup_root = $PSScriptRoot

# _forge_setup_present SCRIPT: tell if the script can be run; warn if not, for all else works without.
function _forge_setup_present([string] $Script) {
  if (-not (Test-Path -LiteralPath $Script -PathType Leaf)) {
    [Console]::Error.WriteLine("warning: '$Script' is not there any more and is left out")
    return $false
  }
  if ($env:COLCON_TRACE) {
    [Console]::Out.WriteLine("# . `"$Script`"")
  }
  return $true
}

# _forge_setup_sh SCRIPT: let sh source a script that is not for PowerShell, and take over what that changes
# in the environment. Functions and aliases stay in sh.
function _forge_setup_sh([string] $Script) {
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

# The workspace /opt/ros/humble.
if (_forge_setup_present "/opt/ros/humble/local_setup.sh") {
  $env:COLCON_CURRENT_PREFIX = "/opt/ros/humble"
  _forge_setup_sh "/opt/ros/humble/local_setup.sh"
  $env:COLCON_CURRENT_PREFIX = $null
}

# The workspace /home/a b/install.
if (_forge_setup_present "/home/a b/install/local_setup.ps1") {
  $env:COLCON_CURRENT_PREFIX = "/home/a b/install"
  . "/home/a b/install/local_setup.ps1"
  $env:COLCON_CURRENT_PREFIX = $null
}

# This workspace.
if (_forge_setup_present "$_forge_setup_root/local_setup.ps1") {
  $env:COLCON_CURRENT_PREFIX = "$_forge_setup_root"
  . "$_forge_setup_root/local_setup.ps1"
  $env:COLCON_CURRENT_PREFIX = $null
}

Remove-Item Function:_forge_setup_present
Remove-Item Function:_forge_setup_sh
Remove-Variable _forge_setup_root
