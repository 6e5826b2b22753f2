"""Descriptions that Berth writes, read by the npm package `canopen`: every file of the folder of real descriptions
(BERTH_EDS_DIR, else shared/eds beside the repository) and of examples/eds."""

import glob
import json
import os
import subprocess
import tempfile

import npm_peer
import support
from matrix import tries

READ = """
const load = require('module')._load;
require('module')._load = (name, ...rest) => name === 'node-crc' ? {} : load(name, ...rest);
const canopen = require('canopen');
const eds = canopen.Eds.fromFile(process.argv[1]);
const objects = {};
for (const entry of eds.values()) objects[entry.index] = entry.parameterName;
console.log(JSON.stringify({ objects, vendor: eds.vendorNumber, bootUp: eds.simpleBootUpSlave }));
"""


def folder():
    named = os.environ.get("BERTH_EDS_DIR")
    return named or os.path.join(support.ROOT, "..", "shared", "eds")


class Descriptions(support.Case):
    @classmethod
    def setUpClass(cls):
        npm_peer.install()

    def read(self, path):
        environment = dict(os.environ, NODE_PATH=os.path.join(npm_peer.PLACE, "node_modules"))
        done = subprocess.run(["node", "-e", READ, path], capture_output=True, text=True, env=environment,
                              timeout=support.PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr[-1500:])
        return json.loads(done.stdout)

    @tries("npm master", "EDS load")
    @tries("npm device", "EDS load")
    def test_every_converted_file_loads(self):
        files = [f for kind in ("eds", "dcf", "xdd") for where in (folder(), support.example("eds"))
                 for f in sorted(glob.glob(os.path.join(where, f"*.{kind}")))]
        self.assertGreaterEqual(len(files), 3)
        with tempfile.TemporaryDirectory() as place:
            for file in files:
                with self.subTest(os.path.basename(file)):
                    written = os.path.join(place, os.path.basename(file) + ".eds")
                    support.berth("eds", "convert", file, written, status=None)
                    with open(written, encoding="latin-1") as text:
                        empty = [line for line in text if line.rstrip("\r\n").endswith("Number=")]
                    self.assertEqual(empty, [], "a number without digits")
                    described = {int(o["index"], 0) for o in support.berth_json("eds", "show", written)["objects"]}
                    read = self.read(written)
                    self.assertEqual({int(i) for i in read["objects"]}, described)
