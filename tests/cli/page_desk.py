"""Writes into the current folder what the pages of docs/ take for granted: a machine, its plant, descriptions, traces.

usage: page_desk.py BERTH EXAMPLES
"""
import pathlib
import shutil
import subprocess
import sys

berth, examples = sys.argv[1], pathlib.Path(sys.argv[2])
for name in ("eds/drive.eds", "eds/io.eds", "eds/pump.eds", "eds/pump.dcf", "eds/sensor.eds", "eds/belt.eds",
             "programs/controller-2.bprg"):
    shutil.copy(examples / name, pathlib.Path(name).name)


def with_channels(eds):
    """io.eds with one SDO channel more as server, and one as client."""
    eds = eds.replace("SupportedObjects=18", "SupportedObjects=20").replace("18=0x6206", "18=0x6206\n19=0x1201\n20=0x1280")
    for index in ("1201", "1280"):
        eds += f"\n[{index}]\nParameterName=SDO parameter\nObjectType=0x9\nSubNumber=4\n"
        for sub, kind, value in ((0, 5, "3"), (1, 7, "0x80000000"), (2, 7, "0x80000000"), (3, 5, "0")):
            eds += (f"\n[{index}sub{sub}]\nParameterName=part {sub}\nObjectType=0x7\nDataType={kind:#06x}\n"
                    f"AccessType={'const' if sub == 0 else 'rw'}\nDefaultValue={value}\nPDOMapping=0\n")
    return eds


def described(name, product):
    """NAME.xdd: the I/O module under another product code, with a unit and with names of values."""
    eds = with_channels(pathlib.Path("io.eds").read_text()).replace("ProductNumber=0x00000003",
                                                                   f"ProductNumber={product:#010x}")
    pathlib.Path(f"{name}.made.eds").write_text(eds)
    subprocess.run([berth, "eds", "convert", f"{name}.made.eds", f"{name}.xdd"], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    parameters = (
        "<co:ApplicationProcess><co:parameterList>"
        "<co:parameter uniqueID=\"P1\" access=\"readWrite\"><label lang=\"en\">t</label><INT/>"
        "<co:unit multiplier=\"0.1\"><label lang=\"en\">°C</label></co:unit></co:parameter>"
        "<co:parameter uniqueID=\"P2\" access=\"readWrite\"><label lang=\"en\">d</label><USINT/><co:allowedValues>"
        "<co:value value=\"1\"><label lang=\"en\">Forward</label></co:value>"
        "<co:value value=\"2\"><label lang=\"en\">Reverse</label></co:value>"
        "</co:allowedValues></co:parameter>"
        "<co:parameter uniqueID=\"P3\" access=\"read\"><label lang=\"en\">s</label><UINT/></co:parameter>"
        "</co:parameterList></co:ApplicationProcess>")
    objects = ("<CANopenObject index=\"5F00\" name=\"Set point\" objectType=\"7\" uniqueIDRef=\"P1\"/>"
               "<CANopenObject index=\"5F01\" name=\"Direction\" objectType=\"7\" uniqueIDRef=\"P2\"/>"
               "<CANopenObject index=\"6041\" name=\"Statusword\" objectType=\"7\" uniqueIDRef=\"P3\"/>")
    file = pathlib.Path(f"{name}.xdd")
    text = file.read_text()
    text = text.replace("</ProfileBody>", parameters + "</ProfileBody>", 1).replace(
        "</co:CANopenObjectList>", objects + "</co:CANopenObjectList>")
    file.write_text(text)


SLOTS = (("s1", 2, "io.eds"), ("s2", 4, "pump.eds"), ("panel", 3, "panel.xdd"), ("drive", 5, "drive.xdd"),
         ("heater", 6, "heater.xdd"))
for name, product in (("panel", 0x41), ("drive", 0x42), ("heater", 0x43)):
    described(name, product)
machine = '[machine]\nname = "desk"\n\n[bus.field]\nport = "{port}"\nbitrate = 125_000\nmaster_id = 1\n'
plant = "[plant]\nseed = 1\n\n[bus.field]\nbitrate = 125_000\n"
for number, (name, node, file) in enumerate(SLOTS, 1):
    machine += f'\n[[slot]]\nbus = "field"\nid = {node}\nname = "{name}"\neds = "{file}"\n'
    plant += f'\n[[device]]\nbus = "field"\nname = "{name} device"\neds = "{file}"\nserial = {number}\n'
plant += '\n[[device]]\nbus = "field"\nname = "spare pump"\neds = "pump.eds"\nserial = 9\nplugged = false\n'
pathlib.Path("machine.toml").write_text(machine.replace("{port}", "sim"))
pathlib.Path("plant.toml").write_text(plant)

# A bus alone, with a device that has its node-ID, and one that has none.
pathlib.Path("alone.plant.toml").write_text(
    "[bus.can0]\nbitrate = 125_000\n\n[[device]]\nbus = \"can0\"\nname = \"pump\"\neds = \"pump.eds\"\nserial = 0x42\n"
    "node_id = 5\nheartbeat = \"100 ms\"\n\n[[device]]\nbus = \"can0\"\nname = \"blank\"\n"
    "type = { vendor = 1, product = 4, revision = 0x10000 }\nserial = 9\n")
pathlib.Path("run.log").write_text(
    "(1.000000) can0 705#05\n(1.100000) can0 605#4018100400000000\n(1.101000) can0 585#4318100442000000\n"
    "(1.200000) can0 605#4000200000000000\n(1.201000) can0 585#8000200000000206\n(1.300000) can0 605#4017100000000000\n"
    "(1.301000) can0 585#4B171000F4010000\n(2.000000) can0 705#05\n")
