# 'forge shell' starts zsh with the folder of this file as ZDOTDIR; FORGE_ZDOTDIR is the user's.
_forge_zdotdir=$ZDOTDIR
ZDOTDIR=$FORGE_ZDOTDIR
[[ ! -f $ZDOTDIR/.zshenv ]] || . "$ZDOTDIR/.zshenv"
FORGE_ZDOTDIR=$ZDOTDIR
ZDOTDIR=$_forge_zdotdir
unset _forge_zdotdir
