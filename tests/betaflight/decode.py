"""What yamspy, an independent client, decodes from a reply."""

import logging

import yamspy

logging.disable(logging.CRITICAL)


def _attributes(client):
    """Where yamspy puts the values of each message, in the order of the fields."""
    config, sensors, analog = client.CONFIG, client.SENSOR_DATA, client.ANALOG
    status = ["cycleTime", "i2cError", "activeSensors", "mode", "profile"]
    return {
        1: lambda: [config["mspProtocolVersion"], config["apiVersion"]],
        2: lambda: [config["flightControllerIdentifier"]],
        3: lambda: [config["flightControllerVersion"]],
        4: lambda: [config[key] for key in ("boardIdentifier", "boardVersion", "boardType", "commCapabilities", "targetName",
                                            "boardName", "manufacturerId", "mcuTypeId")],
        5: lambda: [config["buildInfo"]],
        10: lambda: [config["name"]],
        32: lambda: [client.BATTERY_CONFIG[key] for key in ("vbatmincellvoltage", "vbatmaxcellvoltage", "vbatwarningcellvoltage",
                                                            "capacity", "voltageMeterSource", "currentMeterSource")],
        34: lambda: [[r["id"], r["auxChannelIndex"], r["range"]["start"], r["range"]["end"]] for r in client.MODE_RANGES],
        36: lambda: [client.FEATURE_CONFIG["featuremask"]],
        44: lambda: [client.RX_CONFIG[key] for key in ("serialrx_provider", "stick_max", "stick_center", "stick_min",
                                                       "spektrum_sat_bind", "rx_min_usec", "rx_max_usec")],
        54: lambda: [[port["identifier"], port["functions"], port["msp_baudrate"]] for port in client.SERIAL_CONFIG["ports"]],
        58: lambda: [sensors["sonar"]],
        64: lambda: client.RC_MAP,
        75: lambda: [client.FAILSAFE_CONFIG[key] for key in (
            "failsafe_delay", "failsafe_off_delay", "failsafe_throttle", "failsafe_switch_mode", "failsafe_throttle_low_delay",
            "failsafe_procedure")],
        94: lambda: [client.ADVANCED_TUNING["levelAngleLimit"]],
        111: lambda: [client.RC_TUNING[key] for key in (
            "RC_RATE", "RC_EXPO", "roll_rate", "pitch_rate", "yaw_rate", "throttle_MID", "throttle_EXPO", "RC_YAW_EXPO", "rcYawRate",
            "rcPitchRate", "RC_PITCH_EXPO", "throttleLimitType", "throttleLimitPercent", "roll_rate_limit", "pitch_rate_limit",
            "yaw_rate_limit")],
        77: lambda: [[channel["mode"], channel["value"]] for channel in client.RXFAIL_CONFIG],
        101: lambda: [config[key] for key in status],
        102: lambda: [*sensors["accelerometer"], *sensors["gyroscope"], *sensors["magnetometer"]],
        104: lambda: client.MOTOR_DATA,
        105: lambda: client.RC["channels"],
        108: lambda: sensors["kinematics"],
        109: lambda: [sensors["altitude"]],
        110: lambda: [analog[key] for key in ("voltage", "mAhdrawn", "rssi", "amperage")],
        116: lambda: client.AUX_CONFIG,
        119: lambda: client.AUX_CONFIG_IDS,
        150: lambda: [config[key] for key in (*status, "cpuload", "numProfiles", "rateProfile", "armingDisableCount",
                                              "armingDisableFlags")],
        160: lambda: config["uid"],
    }


class _Bytes:
    """What yamspy reads instead of a serial port."""

    def __init__(self, data):
        self.data = data

    def read(self, size=1):
        taken, self.data = self.data[:size], self.data[size:]
        return taken


class Decoder:
    def __init__(self):
        self.client = yamspy.MSPy("", logfilename=None)
        self.client.INAV = False
        self.attributes = _attributes(self.client)

    def decode(self, frame):
        """(code, values) of one whole frame; values are None if yamspy has no decoder for it, or the frame is an error."""
        self.client.conn = _Bytes(frame)
        self.client.receive_raw_msg = lambda size: self.client.conn.read(size)
        message = self.client.receive_msg()
        if message["unsupported"]:
            return None, None
        if message["packet_error"]:
            raise ValueError(f"yamspy can't read {frame.hex()}")
        code = message["code"]
        if not message["dataView"] or code not in self.attributes:
            return code, None
        if self.client.process_recv_data(message) < 0:
            raise ValueError(f"yamspy can't decode {frame.hex()}")
        return code, list(self.attributes[code]())
