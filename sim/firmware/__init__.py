"""The simulated robot's controller: it speaks ARCOS over TCP or a pseudo-terminal, in real time.

firmware and motion are pure: bytes and senses in, bytes and wheel speeds out, at given times. tcp and terminal are
links. loop ties both to a robot and to the clock.
"""
