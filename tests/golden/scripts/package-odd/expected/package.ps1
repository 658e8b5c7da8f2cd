# Adds the package 'odd' to the environment of the PowerShell that runs it; nothing that it needs.
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

# _forge_append VARIABLE ENTRY: make the entry the last one, unless it is there.
function _forge_append([string] $Variable, [string] $Entry) {
  $held = [Environment]::GetEnvironmentVariable($Variable)
  if (-not $held) {
    [Environment]::SetEnvironmentVariable($Variable, $Entry)
  } elseif ($held.Split(':') -cnotcontains $Entry) {
    [Environment]::SetEnvironmentVariable($Variable, "${held}:$Entry")
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

_colcon_prepend_unique_value PATH "/opt/odd `$HOME"
_forge_append PATH "$_forge_prefix/last"
$env:ODD_MODEL = "the `"great`" one"
if (-not $env:ODD_HOME) {
  $env:ODD_HOME = "$_forge_prefix/share/odd"
}
# A hook of 'odd'.
if (_forge_present "$_forge_prefix/share/odd/hook.sh") {
  $env:COLCON_CURRENT_PREFIX = "$_forge_prefix"
  $env:AMENT_CURRENT_PREFIX = "$_forge_prefix"
  _forge_sh "$_forge_prefix/share/odd/hook.sh"
  $env:COLCON_CURRENT_PREFIX = $null
  $env:AMENT_CURRENT_PREFIX = $null
}
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

Remove-Item Function:_forge_append
Remove-Item Function:_forge_present
Remove-Item Function:_forge_sh
Remove-Variable _forge_prefix
