"""``sgms completion``: print the script with which a shell completes commands, options and their choices."""

from __future__ import annotations

import argparse

HELP = "print a completion script for a shell: source <(sgms completion bash)"

_SHELLS = ("bash", "zsh")
_FUNCTION = """\
_sgms() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" previous="${{COMP_WORDS[COMP_CWORD-1]}}" words=""
    COMPREPLY=()
    if [ "$COMP_CWORD" -le 1 ]; then
        words="{commands}"
    else
        case "${{COMP_WORDS[1]}} $previous" in
{choices}
            *)
                case "$word" in
                    -*)
                        case "${{COMP_WORDS[1]}}" in
{options}
                        esac ;;
                esac ;;
        esac
    fi
    if [ -n "$words" ]; then
        COMPREPLY=($(compgen -W "$words" -- "$word"))
    fi
}}
complete -o default -F _sgms sgms
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("shell", choices=_SHELLS, help="the shell that will read the script")


def run(args: argparse.Namespace) -> int:
    """Do the job, as ``main.Command``."""
    if args.shell == "zsh":
        print("autoload -U +X bashcompinit && bashcompinit")
    print(_script(), end="")
    return 0


def _script() -> str:
    """Return the script, made from the parsers of all commands."""
    from sgms_observer.cli.main import build_parser

    parser = build_parser(None)
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction)).choices
    options, choices = [], []
    for name, subparser in commands.items():
        given = [action for action in subparser._actions if action.option_strings]
        words = " ".join(option for action in given for option in action.option_strings if option.startswith("--"))
        options.append(f'                            {name}) words="{words}" ;;')
        for action in subparser._actions:
            if action.choices:
                places = [f'"{name} {option}"' for option in action.option_strings] or [f'"{name} {name}"']
                values = " ".join(map(str, action.choices))
                choices.append(f'            {"|".join(places)}) words="{values}" ;;')
    return _FUNCTION.format(commands=" ".join(commands), options="\n".join(options), choices="\n".join(choices))
