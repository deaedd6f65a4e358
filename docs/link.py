#!/usr/bin/env python3
"""Talks to the instrument over its serial link; Python's standard library only. The messages: link.md.

    link.py PORT [--start | --self-test] [--raw] [--seconds N]

Prints every report as a line of JSON. With --raw the stream is asked for, and what it holds is compared with the seconds.
"""
import argparse, json, os, select, struct, sys, termios, time, tty, zlib

VERSION = 10
STATES = ["idle", "levelling", "watching", "indexing", "settling", "collecting", "finished", "failed", "calibrating"]
FAULTS = ["settings-missing", "settings-corrupt", "settings-invalid", "near-pole", "not-level-in-time",
          "disturbed-too-long", "jitter-too-long", "level-lost", "motor-stall", "wrong-angle", "encoder-failed",
          "accelerometer-failed", "index-limit", "gyro-silent", "gyro-invalid", "gyro-saturated", "gyro-clock",
          "gyro-link-poor", "gyro-stuck", "gyro-units", "gyro-unanswered", "out-of-time", "aborted", "unsolvable", "no-earth-rate", "not-earth-rate"]
REFUSALS = ["damaged", "other-version", "not-understood", "no-fix", "motor-turns", "out-of-order",
            "settings-unreadable", "settings-invalid", "not-stored", "no-settings", "settings-corrupt", "busy",
            "no-slots", "update-unfit", "update-unsigned", "unconfirmed",
            "no-fix-yet", "log-unreadable", "locked", "not-unlocked"]
ITEMS = ["settings", "memory", "reset", "clock", "gyro", "gyro-rate", "accelerometer", "encoder", "block",
         "accelerometer-response", "index-drive", "limit-switch"]
VERDICTS = ["passed", "failed", "not-asked", "absent", "unmet", "interrupted"]
STEPS = ["turn", "hold-still", "attitude-accepted", "attitude-known", "moved", "not-gravity", "solving"]
REASONS = ["too-few-attitudes", "directions-missing", "moving-throughout", "not-an-ellipsoid", "too-noisy",
           "implausible", "not-better", "not-stored", "accelerometer-failed", "aborted"]
CAUSES = ["panic", "hard-fault", "stack-overflow", "late-task", "watchdog", "brown-out", "clock-stopped"]
COUNTERS = ["frames_good", "frames_bad_crc", "frames_lost", "frames_duplicate", "frames_late", "frames_invalid",
            "bytes_skipped", "bytes_refused", "seconds_repaired", "seconds_left_out", "seconds_outlying",
            "accelerometer_errors", "encoder_errors", "block_errors", "block_missed", "block_saturated",
            "readings_refused", "reports_refused", "commands_bad", "gyro_overruns", "gyro_framing_errors",
            "gyro_noise_errors", "host_overruns", "host_framing_errors", "host_noise_errors", "host_bytes_refused", "ticks_late",
            "ticks_lost", "fixes_not_logged"]


# Readers: each takes a position in the message and gives the value and the position behind it.

def f64(data, at):  # what is not a number is not known, and no JSON
    number = struct.unpack_from("<d", data, at)[0]
    return None if number != number else number, at + 8

def f32(data, at):
    return struct.unpack_from("<f", data, at)[0], at + 4

def byte(data, at):
    return data[at], at + 1

def boolean(data, at):
    return bool(data[at]), at + 1

def unsigned(data, at):
    number = shift = 0
    while True:
        number |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 0x80:
            return number, at

def signed(data, at):
    number, at = unsigned(data, at)
    return number >> 1 ^ -(number & 1), at

def text(data, at):
    return data[at:at + 32].split(b"\0")[0].decode("utf-8", "replace"), at + 32

def blob(data, at):
    length, at = unsigned(data, at)
    return data[at:at + length].hex(), at + length

def one_of(names):
    def read(data, at):
        number, at = unsigned(data, at)
        return names[number], at
    return read

def maybe(reader):
    return lambda data, at: reader(data, at + 1) if data[at] else (None, at + 1)

def several(reader, number):
    def read(data, at):
        values = []
        for _ in range(number):
            value, at = reader(data, at)
            values.append(value)
        return values, at
    return read

def fields(**readers):
    def read(data, at):
        values = {}
        for name, reader in readers.items():
            values[name], at = reader(data, at)
        return values, at
    return read


tilt = fields(pitch_deg=f64, roll_deg=f64)
specific = fields(forward=f64, left=f64)
state, fault = one_of(STATES), one_of(FAULTS)

def direction(data, at):
    return "".join(" -+"[1 if sign == 255 else 2] + axis for sign, axis in zip(data[at:at + 3], "xyz") if sign), at + 3

# The events in the order of their numbers.
EVENTS = [
    ("state", fields(state=state)),
    ("level", fields(tilt=tilt, level=boolean)),
    ("disturbed", fields(excess_deg_h=f64)),
    ("undisturbed", fields(excess_deg_h=f64)),
    ("moving", fields(position=byte, target_deg=f64)),
    ("arrived", fields(position=byte, index_deg=f64)),
    ("jitter", fields(position=byte, change_deg_h=f64)),
    ("settled", fields(position=byte)),
    ("second", fields(t_s=f64, index_deg=maybe(f64), fog_arcsec=f64, moment_arcsec_s=f64, rate_deg_h=f64,
                      temp_c=maybe(f64), block_temp_c=maybe(f64), auxiliary=several(maybe(f32), 6), level=maybe(fields(mean=specific, first=specific)), level_temp_c=maybe(f64), lost_frames=unsigned,
                      dwell=maybe(byte), collected=boolean, waited_at=maybe(one_of(["disturbance", "jitter", "index"])))),
    ("dwell", fields(position=byte, index_deg=f64, seconds=f64, rate_deg_h=f64, sigma_deg_h=f64)),
    ("coarse", fields(azimuth_deg=f64, sigma_deg=f64)),
    ("fix", fields(azimuth_deg=f64, sigma_deg=f64, closure_deg_h=maybe(f64), closure_sigma_deg_h=maybe(f64),
                   chi_square=f64, degrees_of_freedom=unsigned, bias_deg_h=f64, amplitude_deg_h=f64,
                   drift_deg_h_per_h=f64, tilt=maybe(tilt), seconds=f64, flags=unsigned)),
    ("fault", fields(fault=fault, state=state)),
    ("health", fields(**{name: unsigned for name in COUNTERS})),
    ("guidance", fields(step=one_of(STEPS), attitudes=byte, coverage=f64, next=direction)),
    ("calibration", fields(attitudes=byte, judged=byte, left_out=byte, coverage=f64, before_g=f64, after_g=f64,
                           judged_before_g=f64, judged_after_g=f64, evidence=f64, bias_g=several(f64, 3),
                           matrix=several(f64, 6))),
    ("calibration-stored", fields()),
    ("no-calibration", fields(why=one_of(REASONS), missing=maybe(direction))),
    ("crash", fields(cause=one_of(CAUSES), program_counter=unsigned, link_register=unsigned, stack_pointer=unsigned,
                     fault_status=unsigned, program=unsigned, line=unsigned, file=text, message=text)),
    ("vitals", fields(program=unsigned, stack_bytes=unsigned, load_permille=unsigned)),
    ("index-slipped", fields(position=byte, before_deg=f64)),
    ("settings-stored", fields()),
    ("violation", fields(field=text, value=f64)),
    ("heading", fields(heading_deg=f64, pitch_deg=f64, roll_deg=f64, sigma_deg=f64, sigma_level_deg=f64,
                       motion=one_of(["standing", "moving", "bridged"]), refix=boolean)),
    ("answer", fields(number=byte, refusal=maybe(one_of(REFUSALS)))),
    ("identity", fields(board=one_of(["host", "mps2-an386", "stm32f405", "nucleo-f446re"]), version=text, program=unsigned, revision=text,
                        serial=several(unsigned, 3), free_slot=unsigned)),
    ("settings", fields(version=unsigned, length=unsigned, offset=unsigned, bytes=blob)),
    ("raw", fields(number=byte, bytes=blob)),
    ("to-go", fields(seconds=f64)),
    ("self-test", fields(item=one_of(ITEMS), verdict=one_of(VERDICTS), measured=f32, allowed=several(f32, 2))),
    ("fallen-back", fields(dwell_s=unsigned)),
    ("log", fields(next=unsigned, bytes=blob)),
    ("model-aged", fields(signal=one_of(["bias", "amplitude", "misfit", "azimuth-error"]), statistic=f32)),
    ("challenge", fields(bytes=several(byte, 24))),
]


def uncobs(data):
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        block = data[at + 1:at + code]
        if code == 0 or len(block) != code - 1:
            raise ValueError("not COBS")
        out += block
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def cobs(data):
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xFF" + block[:254]
            block = block[254:]
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def report(frame):
    """A frame without its closing 00 as a dictionary."""
    content = uncobs(frame)
    message, check = content[:-4], struct.unpack("<I", content[-4:])[0]
    if zlib.crc32(message) != check:
        raise ValueError("wrong check sum")
    if message[0] != VERSION:
        raise ValueError(f"version {message[0]} of the link, not {VERSION}")
    t_s, at = f64(message, 1)
    number, at = unsigned(message, at)
    name, reader = EVENTS[number]
    values, at = reader(message, at)
    if at != len(message):
        raise ValueError(f"{name}: {len(message) - at} bytes too many")
    return {"t_s": t_s, "event": name, **{("second_t_s" if key == "t_s" else key): value for key, value in values.items()}}


def request(number, ask):
    """The frame of a request: `ask` is the number of what is asked and its fields."""
    message = bytes([VERSION, number]) + ask
    return cobs(message + struct.pack("<I", zlib.crc32(message))) + b"\0"


START, IDENTIFY, STATUS, STREAM, SELF_TEST = b"\x00\x00", b"\x01", b"\x02", b"\x05\x01", b"\x07"

def read_settings(offset):
    return b"\x03" + (bytes([offset]) if offset < 128 else bytes([offset & 127 | 128, offset >> 7]))


class Stream:
    """Follows the raw stream: sums the increments of every second, and misses no block.

    A second ends with the tick of its 400th frame; it is reported some ticks later. (Where frames are lost, the sampler of the
    firmware knows by their numbers where it ends.)"""

    def __init__(self):
        self.next, self.counts, self.frames, self.ticks, self.temperature = None, 0, 0, 0, None
        self.index = self.acceleration = None
        self.ended = []

    def block(self, number, data):
        if self.next not in (None, number):
            raise ValueError(f"block {self.next} of the raw stream is missing")
        self.next, at = (number + 1) % 256, 0
        while at < len(data):
            kind, at = data[at], at + 1
            if kind == 0:
                self.ticks += 1
                if self.frames >= 400:
                    self.ended.append({"raw_frames": self.frames, "raw_counts": self.counts, "raw_index_deg": self.index})
                    self.counts = self.frames = 0
            elif kind == 1:
                self.acceleration, at = several(signed, 3)(data, at)
            elif kind == 2:
                self.index, at = struct.unpack_from("<I", data, at)[0] * 360 / 2**32, at + 4
            elif kind & 0x80:
                increment, at = signed(data, at + 1)
                self.counts, self.frames = self.counts + increment, self.frames + 1
                if kind & 8:
                    self.temperature, at = struct.unpack_from("<h", data, at)[0], at + 2
            else:
                raise ValueError(f"{kind:#04x} begins no item")

    def second(self):
        """What the second held that has just been reported."""
        return self.ended.pop(0) if self.ended else {}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("port")
    arguments.add_argument("--start", action="store_true", help="start a fix, end with it")
    arguments.add_argument("--self-test", action="store_true", help="ask for the self-test, end with its last item")
    arguments.add_argument("--raw", action="store_true", help="ask for the raw stream")
    arguments.add_argument("--seconds", type=int, default=0, help="end after so many seconds of measuring")
    options = arguments.parse_args()
    port = os.open(options.port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)
    speed = termios.tcgetattr(port)
    speed[4] = speed[5] = termios.B115200
    termios.tcsetattr(port, termios.TCSANOW, speed)
    asks = [IDENTIFY, STATUS, read_settings(0)] + [STREAM] * options.raw + [START] * options.start + [SELF_TEST] * options.self_test
    for number, ask in enumerate(asks, 1):
        os.write(port, request(number, ask))
    rest, stream, seconds, heard, accepted = b"", Stream(), 0, time.monotonic(), False
    while not (options.seconds and seconds >= options.seconds):
        if select.select([port], [], [], 1.0)[0]:
            rest, heard = rest + os.read(port, 4096), time.monotonic()
        elif time.monotonic() - heard > 10:
            sys.exit("nothing was heard for 10 s")
        *frames, rest = rest.split(b"\0")
        for frame in filter(None, frames):
            try:
                told = report(frame)
            except (ValueError, IndexError) as error:
                if frame.startswith(b"$") and frame.endswith(b"\r\n"):  # an NMEA sentence
                    continue
                print(f"a frame was dropped: {error}", file=sys.stderr)
                continue
            if told["event"] == "raw":
                stream.block(told["number"], bytes.fromhex(told["bytes"]))
                continue
            if told["event"] == "second":
                seconds += 1
                told |= stream.second() if stream.next is not None else {}
            print(json.dumps(told), flush=True)
            if (options.start or options.self_test) and told["event"] == "answer" and told["number"] == len(asks):
                accepted = told["refusal"] is None
                if not accepted:
                    return
            if accepted and options.self_test and told.get("item") == ITEMS[-1]:
                return
            if accepted and told["event"] == "state" and told["state"] in ("finished", "failed"):
                return


if __name__ == "__main__":
    main()
