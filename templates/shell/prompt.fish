# 'forge shell' starts fish with this file after config.fish.
functions --copy fish_prompt __forge_shell_prompt
function fish_prompt
    echo -n "($FORGE_SHELL) "
    __forge_shell_prompt
end
