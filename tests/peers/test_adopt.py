"""A machine that the npm package `canopen` is the master of: Berth refuses to be a second one, and adopts it.

The devices are a plant's, served by Berth; the master is the peer's. What `berth adopt` writes, `berth up --sim` runs."""

import unittest

import npm_peer
import plant_bus
import support
from support import berth, berth_json

MASTER = 77
PLANT = """
[plant]
seed = 7

[bus.field]
bitrate = 500_000

[[device]]
bus = "field"
name = "valve"
type = { vendor = 0x321, product = 5, revision = 0x10001 }
serial = 0x51
node_id = 5
heartbeat = "200 ms"

[[device]]
bus = "field"
name = "drive"
type = { vendor = 0x321, product = 6, revision = 0x10002 }
serial = 0x62
node_id = 6
heartbeat = "200 ms"
"""
UP = """
[machine]
name = "adopt {port}"

[bus.field]
port    = "socketcand://127.0.0.1:{port}/field"
bitrate = 500_000

[[slot]]
bus  = "field"
id   = 5
name = "valve"
type = {{ vendor = 0x321, product = 5 }}
"""


class UnderAnotherMaster(support.Case):
    def setUp(self):
        super().setUp()
        support.need("node", "npm")
        npm_peer.install()
        self.port = plant_bus.serve(self, self.folder, PLANT)
        self.npm = npm_peer.Npm(self, self.port, "field")
        self.npm.js(f"""
            const eds = new canopen.Eds();
            eds.setHeartbeatProducerTime(200);
            my.m = await join('master', new canopen.Device({{ eds, id: {MASTER} }}));
            my.m.device.start();
            my.m.device.nmt.startNode();
            my.timer = setInterval(() => [5, 6].forEach((id) => my.m.device.nmt.startNode(id)), 200);
        """)

    def test_berth_refuses_adopts_and_runs_what_it_wrote(self):
        machine = self.write("second.toml", UP.format(port=self.port))
        refused = support.berth("up", machine, "--yes", "--until", "operational", "--json", status=1)
        self.assertIn(str(MASTER), refused)

        adopted = self.path("adopted.toml")
        report = berth_json("adopt", adopted, "--port", f"socketcand://127.0.0.1:{self.port}/field", "--bus", "field",
                            "--bitrate", "500000")
        self.assertEqual(report["slots"], 2, report)
        with open(adopted) as file:
            text = file.read()
        for word in ("product = 0x00000005", "product = 0x00000006"):
            self.assertIn(word, text)

        plant = self.write("sim.plant.toml", PLANT)
        after = berth_json("up", adopted, "--sim", plant, "--fast", "--until", "operational", "--store",
                           self.path("adopted.db"))
        states = {slot["id"]: slot["state"] for slot in after["slots"]}
        self.assertEqual(states, {5: "operational", 6: "operational"})


if __name__ == "__main__":
    unittest.main()
