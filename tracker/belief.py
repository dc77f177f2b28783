"""What a pose has to show to be believed."""

from __future__ import annotations

from typing import TypeGuard

from tracker.config import TrackerConfig
from tracker.found import Found
from tracker.verification import LEAST_EXPLAINED, Evidence

LEAST_SURFACE = 0.2  # of what should be seen: where less is in place, its colours prove nothing
MOST_SEEN_THROUGH = 0.1  # of what should be seen: of right poses in rendered scenes one of a hundred has over 0.01
# What is seen where nothing was expected has to end where its outline does or to show much of itself, and most of what
# faces the camera has to be in sight: else it may be a patch of a wall, or a can that stands in a table up to its lid.
LEAST_ENDS, LEAST_PROVED, MOST_HIDDEN = 0.7, 0.5, 0.5
# A look-alike may fit as exactly as the object itself, which a confidence is the higher for. Of right poses in carried
# masks (YCB-V replay `hard`, a recording) one of a hundred at most goes beyond each of these, and none does four times
# in a row.
MOST_CONTRADICTED, MOST_OUTSIDE, MOST_SEEN_THROUGH_AGAIN, MOST_GOES_ON = 0.15, 0.2, 0.05, 0.4
# What is seen again has to look as it did while it was followed: of 130 right returns in rendered scenes none agreed
# less in colour, and two were contradicted more; of 7 wrong ones 6 were out by one of the two.
AS_COLOURED, MORE_CONTRADICTED = 0.75, 0.09
AS_EXPLAINED = 0.6  # of what is found out of nowhere: in the place where it was, more of it may be hidden than usual
MOST_DOUBTFUL = 3  # frames in a row in which what is followed may go beyond them


def believed(found: Found | str, followed: bool, config: TrackerConfig) -> TypeGuard[Found]:
    """Whether `doubt` has nothing to say."""
    return not doubt(found, followed, config)


def doubt(found: Found | str, followed: bool, config: TrackerConfig) -> str:
    """Why it is not believed, in words; empty where it is."""
    if isinstance(found, str):
        return found
    lacking = _lacking(found, followed, config)
    return lacking and (found.missed or f"poor fit: {lacking}")


def doubtful(found: Found, config: TrackerConfig) -> bool:
    """Whether it would not be believed of what is seen again, where nobody says which pixels are the object's."""
    unlikely = found.confidence < config.regain
    return not found.masked and (unlikely or bool(_speaks_against(found.hypothesis.evidence)))


def _speaks_against(seen: Evidence) -> str:
    """What speaks against a pose though it may be likely, in words; empty where nothing does."""
    if seen.contradicted > MOST_CONTRADICTED:
        return f"{seen.contradicted:.0%} of what is in place has another colour"
    if seen.outside > MOST_OUTSIDE:
        return f"{seen.outside:.0%} of what should be seen is not there"
    if seen.seen_through > MOST_SEEN_THROUGH_AGAIN:
        return f"{seen.seen_through:.0%} of what should be seen is seen through"
    if seen.goes_on > MOST_GOES_ON:
        return f"what is seen goes on beyond {seen.goes_on:.0%} of its outline"
    return ""


def _unusual(found: Found, out_of_nowhere: bool) -> str:
    """What speaks against a pose as it did not while the object was followed, in words; empty where nothing does."""
    seen, usual = found.hypothesis.evidence, found.usual
    if usual is None:
        return ""
    if seen.colour < AS_COLOURED * usual.colour:
        return f"its colours agree to {seen.colour:.0%}, to {usual.colour:.0%} as it was followed"
    if seen.contradicted > usual.contradicted + MORE_CONTRADICTED:
        return f"{seen.contradicted:.0%} of what is in place has another colour, {usual.contradicted:.0%} had"
    if out_of_nowhere and found.explains < AS_EXPLAINED * usual.explains:
        return f"it explains {found.explains / usual.explains:.0%} of what it usually does"
    return ""


def _lacking(found: Found, followed: bool, config: TrackerConfig) -> str:
    """What a pose lacks. It has to be likely. Where nobody says which pixels are the object's, less is asked where it
    was expected while it is followed than of what is seen again near there or has jumped, so that a state does not
    flicker; and most where nothing was expected."""
    seen, continued = found.hypothesis.evidence, found.masked or (followed and not found.jumped)
    out_of_nowhere = not continued and not found.expected
    if seen.surface < LEAST_SURFACE:
        return f"{seen.surface:.0%} of what should be seen is in place"
    if seen.explained < LEAST_EXPLAINED:
        return f"{seen.explained:.0%} of what is seen there is explained"
    if seen.seen_through > MOST_SEEN_THROUGH:
        return f"{seen.seen_through:.0%} of what should be seen is seen through"
    if not continued and (wrong := _speaks_against(seen)):
        return wrong
    if not continued and (unusual := _unusual(found, out_of_nowhere)):
        return unusual
    if out_of_nowhere and seen.hidden > MOST_HIDDEN:
        return f"at the best pose {seen.hidden:.0%} of it would be hidden"
    if out_of_nowhere and seen.explained < LEAST_ENDS and seen.proved < LEAST_PROVED:
        return "what is seen at the best pose goes on beyond it"
    least = config.believe if continued else config.sure if out_of_nowhere else config.regain
    return "" if found.confidence >= least else f"the best pose is right at {found.confidence:.0%}"
