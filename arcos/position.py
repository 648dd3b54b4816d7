"""How far a robot went between two SIPs, whose counters wrap round."""

POSITION_MASK, POSITION_LIMIT = 0x7FFF, 0x1000
HEADING_TURN = 4096


def position_step(old_raw: int, new_raw: int) -> int:
    """new - old of x or y in raw units: right for counters of 15 and of 16 bits while less than 4096 were covered."""
    step = (new_raw & POSITION_MASK) - (old_raw & POSITION_MASK)
    if step > POSITION_LIMIT:
        return step - POSITION_MASK - 1
    return step + POSITION_MASK + 1 if step < -POSITION_LIMIT else step


def heading_step(old_raw: int, new_raw: int) -> int:
    """new - old of the heading in raw units, the short way round: -2048 to 2047."""
    half = HEADING_TURN // 2
    return (new_raw - old_raw + half) % HEADING_TURN - half
