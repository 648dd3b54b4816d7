"""A program that drives a robot, for tests that stop it: `python robot_caller.py ADDRESS`.

It prints the PID of the driver's process once it drives, and drives on until it is ended. SIGUSR1 makes it hold its
interpreter for three seconds.
"""

import ctypes
import signal
import sys
import time

from hardware.pioneer import connect


def main(address: str) -> None:
    signal.signal(signal.SIGUSR1, lambda *_: ctypes.PyDLL(None).sleep(3))
    with connect(address) as robot:
        robot.arm()
        for k in range(10_000):
            robot.drive(0.25, 0.1)
            if k == 10:
                sys.stdout.write(f"{robot.pid}\n")
                sys.stdout.flush()
            time.sleep(0.05)


if __name__ == "__main__":
    main(*sys.argv[1:])
