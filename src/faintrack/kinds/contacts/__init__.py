"""Contacts of an active sonar: what its detector reports of every ping, one for each echo, among false ones.

A likelihood sums over all that the contacts may mean (`faintrack.likelihoods.contact_sets`), and Bernoulli filters with
particles, newborn about the contacts of a ping, seek and follow targets in the plane. Where all bins above a threshold
are kept, several of an echo, the kind is `returns`.
"""

from pathlib import Path

from faintrack.data.contacts import Contacts
from faintrack.kinds.contacts.sections import ContactsScenario
from faintrack.kinds.kind import Kind
from faintrack.kinds.rooms import room


def _columns(paths: tuple[Path, ...]) -> frozenset[str]:
    from faintrack.io.columns import column_names

    return column_names(paths[0]) if len(paths) == 1 else frozenset()


def _holds(paths: tuple[Path, ...]) -> bool:
    names = _columns(paths)
    # With its level a delay may be that of a bin, too.
    return "range_m" in names or ("delay_s" in names and "snr_db" not in names)


def _takes(paths: tuple[Path, ...]) -> bool:
    """Returns that were clustered have the columns of returns."""
    return bool({"delay_s", "range_m"} & _columns(paths))


def _read(paths: tuple[Path, ...], scenario: ContactsScenario | None) -> Contacts:
    from faintrack.errors import InputError
    from faintrack.io.contacts import read_contacts

    if len(paths) > 1:
        raise InputError(f"{len(paths)} files of contacts were given; expected one file.")
    return read_contacts(paths[0])


def _describe(contacts: Contacts) -> dict[str, str]:
    span, length, count = contacts.times[-1] - contacts.times[0], contacts.length, len(contacts.ping)
    apart = f", {span / (length - 1):.4g} s apart on average" if length > 1 else ""
    facts = {
        "holds": f"{length} pings{apart}",
        "contacts": f"{count}, {count / contacts.heard.sum():.3g} a ping{' and pair' if contacts.pairs else ''}",
        "span": f"{span:g} s",
    }
    for platform, labels in zip(("sources", "receivers"), zip(*contacts.pairs, strict=True), strict=False):
        if any(labels):
            facts[platform] = ", ".join(dict.fromkeys(labels))
    if count:
        name, unit = ("ranges", "m") if contacts.ranged else ("delays", "s")
        facts[name] = f"{contacts.distance.min():g} to {contacts.distance.max():g} {unit}"
    doppler = "not measured"
    if contacts.doppler is not None and count:
        doppler = f"{contacts.doppler.min():g} to {contacts.doppler.max():g} Hz"
    moving = [name for name in ("source", "receiver") if getattr(contacts, name) is not None]
    return {**facts, "doppler": doppler, "platforms": f"{' and '.join(moving) or 'none'} in columns of the file"}


KIND = Kind(
    name="contacts",
    title="Contacts of an active sonar",
    scenario=ContactsScenario,
    data=Contacts,
    holds=_holds,
    read=_read,
    write=room("faintrack.io.contacts", "write_contacts"),
    plan=room("faintrack.kinds.contacts.plan", "plan"),
    simulate=room("faintrack.kinds.contacts.simulate", "simulate"),
    targets=room("faintrack.kinds.contacts.simulate", "targets"),
    silence=room("faintrack.kinds.contacts.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.contacts.report", "about"),
    draw=room("faintrack.kinds.contacts.pictures", "draw"),
    shown="Contacts, existence, position",
    needs=("--scenario FILE",),
    takes=_takes,
    surrogate=lambda data, scenario, seed: room("faintrack.kinds.surrogates", "exchanged")(data, seed),
    stretch=room("faintrack.kinds.stretches", "of_returns"),
    gained=room("faintrack.kinds.promise", "gained_by_target"),
)
