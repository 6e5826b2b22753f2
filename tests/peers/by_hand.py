"""CANopen's services as frames written by hand, for peers that know frames only: what they send to a Berth device
(tests/tools/partner.cpp: node 5, serial number ABh), and what must come back."""

import itertools

SAY, HEAR = "say", "hear"


def say(frame):
    return SAY, frame


def hear(frame):
    return HEAR, frame


# The nine bytes of the block transfers are CRC-16/XMODEM's check string, whose CRC is known to be 31C3h.
SERVICES = {
    "SDO expedited upload": [say("605#4018100400000000"), hear("585#43181004AB000000")],
    "SDO expedited download": [say("605#2F12200064000000"), hear("585#6012200000000000"),
                               say("605#4012200000000000"), hear("585#4F12200064000000")],
    "SDO segmented download": [say("605#2110200008000000"), hear("585#6010200000000000"),
                               say("605#0041424344454647"), hear("585#2000000000000000"),
                               say("605#1D48000000000000"), hear("585#3000000000000000")],
    "SDO segmented upload": [say("605#4010200000000000"), hear("585#4110200008000000"),
                             say("605#6000000000000000"), hear("585#0041424344454647"),
                             say("605#7000000000000000"), hear("585#1D48000000000000")],
    "SDO block download": [say("605#C611200009000000"), hear("585#A41120007F000000"),
                           say("605#0131323334353637"), say("605#8238390000000000"), hear("585#A2027F0000000000"),
                           say("605#D5C3310000000000"), hear("585#A100000000000000")],
    "SDO block upload": [say("605#A41120007F000000"), hear("585#C611200009000000"),
                         say("605#A300000000000000"), hear("585#0131323334353637"), hear("585#8238390000000000"),
                         say("605#A2027F0000000000"), hear("585#D5C3310000000000"), say("605#A100000000000000")],
    "LSS": [say("7E5#4023010000000000"), say("7E5#4107000000000000"), say("7E5#4200000100000000"),
            say("7E5#43AB000000000000"), hear("7E4#4400000000000000"), say("7E5#5E00000000000000"),
            hear("7E4#5E05000000000000"), say("7E5#0400000000000000")],
    "heartbeat": [say("605#2B171000C8000000"), hear("585#6017100000000000"), hear("705#7F"), hear("705#7F")],
    "NMT": [say("000#0105"), hear("705#05"), say("000#0205"), hear("705#04"), say("000#8005"), hear("705#7F"),
            say("000#0105"), hear("705#05")],
    # In operational from here on: object 2000h is in TPDO 1, 2001h in RPDO 1, and in TPDO 2, which each SYNC sends.
    "PDO": [say("605#2B00200034120000"), hear("185#3412"), say("205#78563412"),
            say("605#4001200000000000"), hear("585#4301200078563412")],
    "SYNC": [say("080#"), hear("285#78563412"), say("605#4040200000000000"), hear("585#4340200001000000")],
    "EMCY": [say("605#2B30200020310000"), hear("085#2031050102030405"), hear("585#6030200000000000")],
}


def play(sends, hears, only=SERVICES):
    """`sends(*frames)`: those that follow each other without an answer between, at once: segments of a sub-block, between
    which a server waits a quarter of its time-out. `hears(frame)` waits for it, behind what was heard before, and fails
    when it does not come."""
    for function in only:
        for what, run in itertools.groupby(SERVICES[function], key=lambda step: step[0]):
            frames = [frame for _, frame in run]
            if what == SAY:
                sends(*frames)
            else:
                for frame in frames:
                    hears(frame)
