"""Models of robots that differ from the usual: each walks on feet that carry its weight, or is refused by name."""

import re

import pytest
from support.doors import BadInput, compose_config, make_scenario, roll_out
from support.robots import EXACT, FEET, FREE, OWN, RIGID, ROBOT, TWO, read, turn_frame

from cmacexp.models.robot_search import find_names

TEXT = OWN.read_text()
pytestmark = pytest.mark.ci
ONE = (*ROBOT, *TWO[:-1], "cycles=1", EXACT)
WALKS = ""
NAMES = ("joints", "feet", "home")
END = "</mujoco>"
MOTORS = re.search(r"<actuator>.*</actuator>", TEXT, re.DOTALL)[0]
SERVOS = MOTORS.replace("<motor", '<position kp="50" kv="1"')
FL_FOOT = '<geom name="FL" class="foot" pos="0.005 0 -0.21" mass="0.05"/>'
FL_THIGH = '<joint name="FL_thigh_joint" class="thigh"/>'
NAMELESS = 'machine.feet=["FL_calf","FR_calf","RL_calf","RR_calf"]'
HELD = '<joint joint="FL_hip_joint" coef="1"/>'
BLOCK = '<mesh name="block" vertex="0 0 0 .01 0 0 0 .01 0 0 0 .02"/>'
ABSENT = """<mesh name="look" file="absent.stl"/><texture name="wood" type="2d" file="absent.png"/>
  <material name="paint" texture="wood"/>"""
WHEEL = '<body name="FL_w"><joint name="FL_wheel" axis="0 1 0"/><geom type="sphere" size="0.01" mass="0.01"/></body>'
ANKLE = WHEEL.replace("FL_wheel", "{0}_ankle").replace("FL", "{0}").replace("axis", 'range="-1 1" axis')
CUBE = '<body name="cube"><freejoint/><geom type="box" size="1 1 1" mass="1"/></body>'


def motors(**attributes):
    """All motors with other attributes."""
    more = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    return re.sub(r'class="(hip|thigh|calf)" (joint="\w+")', rf"\2 {more}", MOTORS)


def each_foot(shape):
    """The feet as other shapes."""
    return [('class="foot" pos="0.005 0 -0.21"', shape), ('class="foot" pos="0.005 0 -0.2"', shape)]


def option(text):
    return [("<worldbody>", f"<option {text}</option><worldbody>" if ">" in text else f"<option {text}/><worldbody>")]


def scaled(factor):
    """The model in other units of length, its masses the same."""
    return re.sub(
        r'\b(pos|size|fromto)="([^"]*)"',
        lambda found: f'{found[1]}="{" ".join(f"{float(x) * factor:g}" for x in found[2].split())}"',
        TEXT,
    )


def mirrored():
    """Rear knees that bend forward."""
    knees = re.sub(r'"R[LR]_calf_joint" class="calf"', r'\g<0> range="0.5 2.7"', TEXT)
    return re.sub(r'"R[LR]_thigh_joint" class="thigh"', r'\g<0> range="-3 1"', knees)


TRUNK = re.search(r'<body name="trunk".*?mass="0.7"/>', TEXT, re.DOTALL)[0]
LEGS_ON_THE_WORLD = [(TRUNK, ""), ("</body>\n  </worldbody>", "</worldbody>")]
EVERY_HOME = "machine.home=[[0,0.9,-1.8],[0,0.9,-1.8],[0,-0.9,1.8],[0,-0.9,1.8]]"
OTHERS = r"machine\.path=.*: has {}"
TURNED = r"machine\.feet=.* in the frame of the trunk.* turn the frame"
UNITS = r"machine\.path=.*: the {} is"

ODD = {
    # actuators
    "position servos": ([(MOTORS, SERVOS)], (), WALKS),
    "weak servos": ([(MOTORS, SERVOS.replace("50", "0.001"))], (), WALKS),
    "velocity servos": ([(MOTORS, MOTORS.replace("<motor", '<velocity kv="9"'))], (), WALKS),
    "a motor that pushes to one side": ([(MOTORS, motors(ctrlrange="0 30"))], (), WALKS),
    "gears": ([(MOTORS, motors(ctrlrange="-1 1", gear="30"))], (), WALKS),
    "a force range": ([(MOTORS, motors(forcerange="-30 30"))], (), WALKS),
    "motors without torque": (
        [(MOTORS, motors(ctrlrange="-1 1", gear="0"))],
        (),
        r"machine\.joints=FL_hip_joint: has a motor without torque",
    ),
    "no motors": ([(MOTORS, "")], (), WALKS),
    "some motors": (
        [(MOTORS, "<actuator><motor joint='FR_calf_joint'/></actuator>")],
        (),
        r"machine\.joints=FL_hip_joint: has no actuator in the model",
    ),
    "limits of joints alone": (
        [(MOTORS, ""), ('<joint armature="0.01"', '<joint armature="0.01" actuatorfrcrange="-40 40"')],
        (),
        WALKS,
    ),
    # constraints and forces
    "a weld": (
        [(END, f'<equality><weld name="nail" body1="trunk"/></equality>{END}')],
        (),
        OTHERS.format("an equality constraint"),
    ),
    "a weld that is not active": (
        [(END, f'<equality><weld body1="trunk" active="false"/></equality>{END}')],
        (),
        WALKS,
    ),
    "gravity compensation": (
        [('name="trunk"', 'name="trunk" gravcomp="1"')],
        (),
        OTHERS.format("gravcomp"),
    ),
    "a joint that pushes": (
        [('<joint armature="0.01"', '<joint armature="-0.01"')],
        (),
        r"machine\.path=.*has armature=-0\.01 at joint \w+, which would push",
    ),
    "a tendon with a spring": (
        [
            (
                END,
                f'<tendon><fixed name="rope" stiffness="9">{HELD}</fixed></tendon>{END}',
            )
        ],
        (),
        OTHERS.format("a tendon"),
    ),
    "a tendon that does nothing": (
        [(END, f'<tendon><fixed name="rope">{HELD}</fixed></tendon>{END}')],
        (),
        WALKS,
    ),
    "a weak spring": ([(FL_THIGH, FL_THIGH.replace("/>", ' stiffness="1" springref="0.9"/>'))], (), WALKS),
    "a trunk with losses": ([(FREE, '<joint type="free" damping="50" frictionloss="50" stiffness="9"/>')], (), WALKS),
    "a plugin": (
        [
            ("<worldbody>", '<extension><plugin plugin="mujoco.elasticity.cable"/></extension><worldbody>'),
            (FL_FOOT, f'{FL_FOOT}<plugin plugin="mujoco.elasticity.cable"/>'),
        ],
        (),
        r"machine\.path=.*plugin",
    ),
    # options
    "no gravity": (option('gravity="0 0 0"'), (), WALKS),
    "gravity switched off": (option('><flag gravity="disable" damper="disable" limit="disable"/>'), (), WALKS),
    "no constraints": (option('><flag constraint="disable" contact="disable"/>'), (RIGID,), WALKS),
    "wind in honey": (option('wind="50 0 0" density="1000" viscosity="5"'), (), WALKS),
    "other steps": (option('timestep="0.5" integrator="RK4" iterations="1" solver="PGS"'), (), WALKS),
    "contacts overridden": (option('o_margin="0.1"><flag override="enable" sleep="enable"/>'), (RIGID,), WALKS),
    "little memory": ([("<worldbody>", '<size memory="8K"/><worldbody>')], (), WALKS),
    # other things
    "keyframes and sensors": (
        [
            (END, f'<keyframe><key time="3"/></keyframe><sensor><gyro site="imu"/></sensor>{END}'),
            (FREE, f'{FREE}<site name="imu"/>'),
        ],
        (),
        WALKS,
    ),
    "a mocap body": ([("</worldbody>", '<body name="hook" mocap="true"/></worldbody>')], (), WALKS),
    "a cube beside it": ([("<worldbody>", f"<worldbody>{CUBE}")], (), r"machine\.joints=joint 0 .*: moves, too"),
    "a listed contact": (
        [(END, f'<contact><pair geom1="floor" geom2="FL" margin="1"/></contact>{END}')],
        (RIGID,),
        WALKS,
    ),
    # sizes
    "millimetres": (scaled(1000.0), (), UNITS.format("length of a stretched leg")),
    "inches": (scaled(39.37), (), UNITS.format("length of a stretched leg")),
    "grams": ([('mass="6"', 'mass="6000"')], (), UNITS.format("mass")),
    "tons": ([('mass="0.', 'mass="0.000'), ('mass="6"', 'mass="0.006"')], (), UNITS.format("mass")),
    "no number": ([('mass="6"', 'mass="nan"')], (), r"machine\.path=.*nan in mass, which must be numbers"),
    "inertia in g mm^2": (
        [(FREE, f'{FREE}<inertial pos="0 0 0" mass="6.7" diaginertia="2e4 5e4 6e4"/>')],
        (),
        UNITS.format("moment of inertia of trunk"),
    ),
    # frames and home
    "a frame turned by a quarter": (turn_frame("0.7071 0 0 -0.7071"), (), WALKS),
    "a frame turned by 30 degrees": (turn_frame("0.9659 0 0 0.2588"), (), WALKS),
    "a frame turned, and the angle 0": (
        turn_frame("0.7071 0 0 0.7071"),
        ("machine.yaw=0",),
        TURNED,
    ),
    "a frame on its side": (turn_frame("0.7071 0.7071 0 0"), (), TURNED),
    "a frame on its other side": (
        turn_frame("0.7071 -0.7071 0 0"),
        (),
        r"machine\.feet=FL, FR, RL, RR: .* turn the frame",
    ),
    "mirrored rear knees": (mirrored(), (EVERY_HOME,), WALKS),
    "mirrored rear knees, found": (mirrored(), (), WALKS),
    "mirrored rear knees at one home": (
        mirrored(),
        ("machine.home=[0,0.9,-1.8]",),
        r"machine\.home=.*RL_.*_joint",
    ),
    # what is held, floats or is missing
    "no trunk that floats": ([(FREE, "")], (), WALKS),
    "a wheel": ([(FL_FOOT, WHEEL + FL_FOOT)], (), r"machine\.path=.*hold them by machine\.weld=\[FL_wheel\]"),
    "an ankle": ([(FL_FOOT, ANKLE.format("FL") + FL_FOOT)], (), r"FL_calf_joint > FL_ankle; .*: it is no quadruped"),
    "ankles": (
        [(f'<geom name="{leg}"', f'{ANKLE.format(leg)}<geom name="{leg}"') for leg in FEET],
        (),
        r"RR_calf_joint > RR_ankle: hold those besides hip, thigh and calf of each leg by machine\.weld",
    ),
    "legs on the world": (LEGS_ON_THE_WORLD, (), r"machine\.path=.*put trunk and legs in a <body> with <freejoint/>"),
    "a wheel that is held": (
        [(FL_FOOT, WHEEL + FL_FOOT), (END, f'<sensor><jointpos joint="FL_wheel"/></sensor>{END}')],
        ("machine.weld=[FL_wheel]",),
        WALKS,
    ),
    "a held joint that is none": (
        [(FL_FOOT, f"<body><joint/><geom size='1' mass='1'/></body>{FL_FOOT}")],
        ("machine.weld=[FL_whel]",),
        r"machine\.weld=FL_whel: is no joint of the model, which has FL_hip_joint, FL_thigh_joint, FL_calf_joint, FR",
    ),
    "a mesh and a texture that are missing": (
        [
            ("<worldbody>", f"<asset>{ABSENT}</asset><worldbody>"),
            (FREE, f'{FREE}<geom type="mesh" mesh="look" mass="0" contype="0" conaffinity="0" material="paint"/>'),
        ],
        (),
        WALKS,
    ),
    "a missing mesh that has mass": (
        [
            ("<worldbody>", f"<asset>{ABSENT}</asset><worldbody>"),
            (FREE, f'{FREE}<geom type="mesh" mesh="look" density="9"/>'),
        ],
        (),
        r"machine\.path=.*there is no absent\.stl, which gives trunk its mass",
    ),
    "a template": ([("<worldbody>", '<worldbody><site name="${size}"/>')], (), r"machine\.path=.*: is a template"),
    "feet of another width": ("", ("gait.width=0.2",), WALKS),
    "feet too far apart": ("", ("gait.width=2",), r"gait\.width=2\.0: is beyond what FL_\w+_joint reaches"),
    "rotors that the model lacks": ([('armature="0.01"', "")], (), WALKS),
    "straight legs": ("", ("machine.home=[0,0,0]",), WALKS),
    "legs in the air": (
        "",
        ("machine.home=[0,3.1,-0.6]",),
        r"machine\.home=.*left rear foot",
    ),
    # feet and names
    "names with spaces": ([('name="FL"', 'name="front left"')], ('machine.feet=["front left",FR,RL,RR]',), WALKS),
    "feet by their bodies": ([('name="FL"', ""), ('name="RR"', "")], (NAMELESS,), WALKS),
    "capsules": (each_foot('type="capsule" size="0.02" fromto="0.005 0 -0.1 0.005 0 -0.21"'), (RIGID,), WALKS),
    "boxes": (each_foot('type="box" size="0.02 0.02 0.01" pos="0.005 0 -0.21"'), (), WALKS),
    "cylinders": (each_foot('type="cylinder" size="0.02 0.01" euler="1.5708 0 0" pos="0.005 0 -0.21"'), (), WALKS),
    "ellipsoids": (each_foot('type="ellipsoid" size="0.02 0.01 0.03" pos="0.005 0 -0.21"'), (RIGID,), WALKS),
    "meshes": (
        [
            ("<worldbody>", f"<asset>{BLOCK}</asset><worldbody>"),
            *each_foot('type="mesh" mesh="block" pos="0.005 0 -0.21"'),
        ],
        (),
        WALKS,
    ),
    "a site": ([(FL_FOOT, f'{FL_FOOT.replace("FL", "ball")}<site name="FL" pos="0.005 0 -0.21"/>')], (), WALKS),
}


def make(folder, change):
    """A model file of a text, or of replacements in the project's own."""
    text = TEXT
    for old, new in change if isinstance(change, list) else ():
        assert old in text
        text = text.replace(old, new)
    path = folder / "odd.xml"
    path.write_text(change if isinstance(change, str) and change else text)
    return path


REFUSED = {what: each for what, each in ODD.items() if each[2]}
IN_CI = (
    *(
        "position servos",
        "names with spaces",
        "meshes",
        "boxes",
        "ellipsoids",
        "wind in honey",
        "no trunk that floats",
    ),
    *("a frame turned by 30 degrees", "mirrored rear knees, found", "a wheel that is held", "feet of another width"),
    *("a mesh and a texture that are missing", "rotors that the model lacks"),
)
WALK = [
    pytest.param(*each[:2], marks=[pytest.mark.nightly] * (what not in IN_CI), id=what)
    for what, each in ODD.items()
    if not each[2]
]


@pytest.mark.parametrize(("change", "overrides", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_walk_is_refused_by_name(tmp_path, change, overrides, message):
    with pytest.raises(BadInput, match=message):
        make_scenario(compose_config([*ONE, f"machine.path={make(tmp_path, change)}", *overrides]))


@pytest.mark.parametrize(("change", "overrides"), WALK)
def test_an_odd_model_walks_on_feet_that_carry_its_weight(tmp_path, change, overrides):
    require_walk([*ONE, f"machine.path={make(tmp_path, change)}", *overrides])


def require_walk(overrides):
    scenario = make_scenario(compose_config(overrides))
    run = roll_out(scenario)
    assert run.status == "completed", run.cause
    weight, height = scenario.setup.mechanism.weight, scenario.setup.config.machine.hip_height
    assert run.columns()["force"].sum(axis=1).mean() == pytest.approx(weight, rel=0.03)
    assert run.body_columns()["height"] == pytest.approx(height, rel=0.05)


URDF_LEG = """
<joint name="{0}_HAA" type="revolute"><parent link="base"/><child link="{0}_hip"/><origin xyz="{1} {2} 0"/>
  <axis xyz="1 0 0"/><limit lower="-0.9" upper="0.9" effort="31" velocity="9"/>
  <dynamics damping="0.5" friction="0.2"/></joint>
<link name="{0}_hip"><inertial><mass value="0.6"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>
  </inertial><visual><geometry><mesh filename="package://nowhere/hip.dae"/></geometry></visual></link>
<joint name="{0}_HFE" type="revolute"><parent link="{0}_hip"/><child link="{0}_thigh"/><origin xyz="0 {3} 0"/>
  <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="32" velocity="9"/><dynamics damping="0.5"/></joint>
<link name="{0}_thigh"><inertial><origin xyz="0 0 -0.1"/><mass value="0.8"/>
  <inertia ixx="3e-3" ixy="0" ixz="0" iyy="3e-3" iyz="0" izz="1e-3"/></inertial>
  <collision><geometry><mesh filename="package://nowhere/thigh.stl"/></geometry></collision></link>
<joint name="{0}_KFE" type="revolute"><parent link="{0}_thigh"/><child link="{0}_shank"/><origin xyz="0 0 -0.2"/>
  <axis xyz="0 1 0"/><limit lower="{4}" upper="{5}" effort="33" velocity="9"/><dynamics damping="0.5"/></joint>
<link name="{0}_shank"><inertial><origin xyz="0 0 -0.1"/><mass value="0.2"/>
  <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-5"/></inertial></link>
<joint name="{0}_ankle" type="fixed"><parent link="{0}_shank"/><child link="{0}_FOOT"/>
  <origin xyz="0 0 -0.2"/></joint>
<link name="{0}_FOOT"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
"""


def write_urdf(folder):
    """A robot as Drake has it, whose rear knees bend forward, without its meshes and with a root without mass."""
    corners = (("RH", -1, -1), ("LH", -1, 1), ("RF", 1, -1), ("LF", 1, 1))
    legs = [
        URDF_LEG.format(name, 0.19 * x, 0.05 * y, 0.08 * y, *((-2.7, -0.3) if x > 0 else (0.3, 2.7)))
        for name, x, y in corners
    ]
    base = """<robot name="r" xmlns="http://drake.mit.edu"><link name="root"/>
      <joint name="stand" type="fixed"><parent link="world"/><child link="root"/></joint>
      <joint name="fix" type="fixed"><parent link="root"/><child link="base"/></joint>
      <link name="base"><inertial><mass value="6"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.09"/></inertial></link>"""
    (folder / "robot of ours.urdf").write_text(f"{base}{''.join(legs)}</robot>")
    return folder / "robot of ours.urdf"


def test_a_urdf_walks_with_its_limits_and_losses_by_the_names_that_are_found(tmp_path):
    path = write_urdf(tmp_path)
    joints, feet, home = find_names(path)
    legs = ("LF", "RF", "LH", "RH")
    assert joints == [[f"{leg}_{name}" for name in ("HAA", "HFE", "KFE")] for leg in legs]
    assert feet == [f"{leg}_FOOT" for leg in legs]
    assert [angles[2] < 0.0 for angles in home] == [True, True, False, False]
    robot = read(path, joints, feet, home)
    assert robot.mass == pytest.approx(12.4)
    assert list(robot.torque_limits) == [31.0, 32.0, 33.0]
    assert (list(robot.friction), list(robot.damping)) == ([0.2, 0.0, 0.0], [0.5] * 3)
    names = [
        f"machine.{name}={value}".replace("'", "") for name, value in zip(NAMES, (joints, feet, home), strict=True)
    ]
    require_walk([*ONE, *names, f"machine.path='{path}'", "sampling_period=0.0005"])


ZERO = " ".join(f'i{axes}="0"' for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))


def test_links_without_inertia_are_named(tmp_path):
    path = write_urdf(tmp_path)
    path.write_text(path.read_text().replace('ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-5"', ZERO))
    (note,) = (note for note in read(path, *find_names(path)).notes if "inertia" in note)
    assert note.startswith("links without mass or inertia")
    assert "_shank" in note


def test_a_link_of_hardly_any_mass_is_read_and_one_that_moves_without_mass_is_named(tmp_path):
    path = write_urdf(tmp_path)
    text = path.read_text()
    inertial = f'<inertial><mass value="1e-9"/><inertia {ZERO}/></inertial>'
    path.write_text(re.sub('link name="[LR][FH]_FOOT">', rf"\g<0>{inertial}", text))
    assert read(path, *find_names(path)).mass == pytest.approx(12.4)
    path.write_text(re.sub(r'("LF_thigh">)<inertial>.*?</inertial>', r"\1", text, flags=re.DOTALL))
    with pytest.raises(BadInput, match=r"LF_thigh moves but has no mass or inertia: give it, .* an <inertial>"):
        find_names(path)


def test_rotor_inertia_of_a_urdf_as_raisim_has_it_is_read(tmp_path):
    path = write_urdf(tmp_path)
    text = path.read_text()
    path.write_text(text.replace("<dynamics", '<dynamics rotor_inertia="0.012"'))
    names = find_names(path)
    assert read(path, *names).armature.ravel() == pytest.approx(0.012)


LOOK = ("<worldbody>", f"<asset>{ABSENT}</asset><worldbody>")
FIXED = '<body name="wall"><geom type="mesh" mesh="look"/></body>'


def test_meshes_of_what_is_fixed_to_the_world_are_left_out_and_pointers_count_as_missing(tmp_path):
    path = make(tmp_path, [(LOOK[0], f'{LOOK[1]}<geom type="mesh" mesh="look"/>{FIXED}')])
    (tmp_path / "absent.stl").write_text("version https://git-lfs.github.com/spec/v1")
    note = "without the missing absent.stl (a Git LFS pointer: run git lfs pull), absent.png, which a run"
    assert read(path).notes[0].startswith(note)
    path = make(tmp_path, [LOOK, (FREE, '<geom type="mesh" mesh="look" density="9"/>')])
    with pytest.raises(BadInput, match=r"there is no absent\.stl \(a Git LFS .*\), which gives trunk its mass"):
        read(path)
