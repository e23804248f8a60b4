"""`python -m ffhnet`: the command, in the form that launchers such as torchrun start."""

from ffhnet.apps.cli import main

if __name__ == "__main__":
    main()
