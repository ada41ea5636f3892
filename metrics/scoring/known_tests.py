"""The named benchmarks: one table of them, for rooms and for questions.

The benchmark knows a set by the digest of its truth, wherever its files lie. A set whose digest
changes gets a new version; the old one stays listed, so that scores on it keep their name.
"""

from dataclasses import dataclass
from typing import Literal

Task = Literal["rooms", "iqtt", "measured"]


@dataclass(frozen=True)
class KnownTest:
    """A file of a test set.

    Attributes:
        name: of the set, with its version; `set/part` for a file of several.
        digest: `Meta.truth_digest` of its scores.
        rows: how many images or questions it has.
        command: what makes the set, but for its place.
        purpose: what it is for.
        pictures: digest of the images; empty where they differ between machines by rounding, and
            `scenegen verify` or `iqtt audit` compares them.
        superseded: whether older code made it, whose bits were others.
    """

    name: str
    task: Task
    digest: str
    rows: int
    command: str
    purpose: str = ""
    pictures: str = ""
    superseded: bool = False

    @property
    def file(self) -> str:
        """Where the file lies in the folder to which the set is made."""
        part = self.name.partition("/")[2]
        return f"{part}/iqtt-test-answers.h5" if part else f"{self.name}.h5"


_RENDER = "scenegen render --n 300 --views 0,5,35,55,80"
_QUESTIONS = {  # purpose, questions of each distractor type, command
    "rotation-1": (
        "mental-rotation questions, by distractor type",
        500,
        "iqtt make-split --preset suite --train 0 --labeled 0 --val 0 --test 500",
    ),
    "perspective-1": (
        "questions about furnished rooms, by distractor type",
        300,
        "iqtt make-split --preset perspective-suite --train 0 --labeled 0 --val 0 --test 300"
        " --seed 1000 --object-split test --spp 16 --denoise --shard-size 10",
    ),
}
_ROOMS = {  # purpose, rows, command
    "sample-1": ("the rooms in examples/sample", 8, "scenegen render --n 8 --size 48"),
    "rooms-1": (
        "main benchmark: rooms with basic shapes",
        1500,
        f"{_RENDER} --seed 1000 --size 64",
    ),
    "rooms-shadows-1": (
        "basic shapes that cast shadows, in other rooms",
        1500,
        f"{_RENDER} --seed 2000 --size 64 --shadows",
    ),
    "rooms-128-1": ("the scenes of rooms-1 at 128 pixels", 1500, f"{_RENDER} --seed 1000"),
    "objects-1": (
        "built-in objects of the test split",
        1500,
        f"{_RENDER} --seed 1000 --size 64 --preset shapenet --object-split test",
    ),
    "solids-1": (
        "basic shapes with all surfaces along each ray",
        300,
        "scenegen render --n 300 --seed 1000 --with layers",
    ),
    "solids-objects-1": (
        "built-in objects of the test split, with all surfaces along each ray",
        300,
        "scenegen render --n 300 --seed 1000 --preset shapenet --object-split test --with layers",
    ),
    "interiors-512-1": (
        "furnished rooms, for networks trained on photographs",
        400,
        "scenegen render --preset interiors --n 100 --views 0,10,20,30 --seed 1000 --size 512"
        # Shards, as an interrupted command keeps those that are complete.
        " --object-split test --spp 16 --denoise --shard-size 10",
    ),
}
# Digests of truth and pictures. `bench sets make NAME` prints those of the files that it makes.
_DIGESTS = {
    "sample-1": (
        "684016ef4ee8d4f1ba4690e48d74cb6a629a731417207aedd5e51ffaccac87e9",
        "45788657b41edbf4c1458a3369070f77f33c566f61cdcdeb83e06159e2be9bd6",
    ),
    "rooms-1": (
        "b77ff4bf7a8c552e3bdd1e4d973e88db53b8c4cec01d756fbdf31622f653c7e1",
        "8af3bf531533c22d246505d93c540bf2efdc2ce7a0582c0e478b0579ea43b565",
    ),
    "rooms-shadows-1": (
        "083e0a36482353f74c8aaf730970e1b08f7a33af54c10227f69105de5d765e65",
        "c96a1253a6f590970ed9d84480e07d13d25632d49bcac2587371b7da86b454a0",
    ),
    "rooms-128-1": (
        "0a4bd47f19e7b6d4d5c01e06b791bb8d47fd2e5e13363daaaaf90312e417e13b",
        "ff0118405c21d0362e507bbb51ea2e2993858b005fca1eedf83b188830e18480",
    ),
    "objects-1": (
        "d8a28d7e6ef90885a4f649b51adcbb30096547b5ab00df71931ba87834788101",
        "1382577a054c986325744e6dc76009e5a68743c9279e064b66b2bc85a32f7101",
    ),
    "solids-1": (
        "3e861fabfd4772b1ad2737c681a0fd8e33966b761a5f242305297119d51b2343",
        "1361175ee119e39feeffd380f052f2c00e78e629c14f6464bdbd437414d25a0f",
    ),
    "solids-objects-1": (
        "38823b78cff0100bda0740c5a1fc5eb36af73e7f0510d74c4d8d9a182be6b0a8",
        "3fcd7d386d972db1c715da962a028499a028dc1b60ac761abffc97946824d3a3",
    ),
    "interiors-512-1": (
        "1faa5b6fe7dc1ac382718288dc67b3b2ee788a278b718d3030be4ba38b383e22",
        "",
    ),
    "rotation-1/matched": (
        "bb5a820ba6286741333664ea534ef90cacd2dad68928459b643c66c0172711d8",
        "deb7a0473ce70c15e3f8a03a57b0ff67b8f37cc4652cf1b2ada5d84c2172fee6",
    ),
    "rotation-1/mirror-pair": (
        "775e2b64d89fb6184416a74f6ec9438bde0958651263f35b501b4d45d2f7b9ab",
        "ee9340b2f44fd2ce10dc361eb1bbb37503acc8eb245adf22f3471c672f87aa33",
    ),
    "rotation-1/mirror-pair-2": (
        "43e197c6cdfa2d7b9a92d263a515b7a1b4f45685885982b7675f03009cfd0290",
        "729c797650d4311aeaaadfb1923825eefb46b4a1b3218878fe4ba88ac0709265",
    ),
    "rotation-1/other": (
        "e55df77274b4f65ad444b9a3d7b07ce254642d20b8b5673d6188c06cdc6f7b63",
        "9a38a7132b24a2b3b7884e1ba7aaa3d30cffb23d09f24809e0633cff0250bf98",
    ),
    "rotation-1/near": (
        "856fda0ceca7a25a94f748a1798e5f55c07507acdd10ae7b7c63f11e1aa45384",
        "237cbe80134f7096f1d4571d44c43bd975463eadc11b2cc8b5c7539348bc95d1",
    ),
    "rotation-1/mirror": (
        "b5d9481c8f6ac819383869de64c514c1a05dccbb6bbaba66892681a6eacd43f0",
        "23b685fb1fcd5bd170ecb34acaa926904013188bd16413ed81ff4efc3cf6049a",
    ),
    "perspective-1/moved": (
        "ec8c5cdc474999fc5bb7b46810148a93a0ca58043ee79c2b260b9ba0ecdb2d51",
        "",
    ),
    "perspective-1/turned": (
        "da93a1f60b18d1975f9e19da7470dc92d2a132175283abe4d5001e0287261cd5",
        "",
    ),
}
# What older code made, whose bits were others: name, rows, digest of the truth, options.
_VIEWS = "--views 0,5,35,55,80 --seed 1000"
_SUPERSEDED = (
    ("examples/sample", 8,
     "6d2a4170b2a42be92410c52c81a2c56d108523820a988704564a7e9b22ee0f4b", "--n 8 --size 48"),
    ("1,000 rooms, seed 1000", 1000,
     "db8c4f30cf0da0c6ce37c09c642b25af9d6e10eb4bca11efb4ef5ca919824107", "--n 1000 --seed 1000"),
    ("300 rooms of the README", 1500,
     "f40106593f40af3e40f298efbd74f7abade2909a6c6edfd182151279e2c50c06",
     f"--n 300 --size 64 {_VIEWS}"),
    ("test-shapes-single", 5000,
     "d5464a3807a180002dfc0bddf5c1745d862564c15874223e64a990292a8bf3dc",
     f"--preset shapes-single --n 1000 {_VIEWS}"),
    ("test-shapes", 5000,
     "d025e6fc432363c08b068a8b0573ceacbcc2d9d0efa6d90ec4fabaded989b634",
     f"--preset shapes --n 1000 {_VIEWS}"),
    ("test-shapenet", 5000,
     "bfa4bdaf2f5c1e64a81c8299ca20da9f3599b825b97e2162e91170529cf5fe67",
     f"--preset shapenet --object-split test --n 1000 {_VIEWS}"),
)  # fmt: skip
KNOWN_TESTS = (
    *(
        KnownTest(name, "rooms", _DIGESTS[name][0], rows, command, purpose, _DIGESTS[name][1])
        for name, (purpose, rows, command) in _ROOMS.items()
    ),
    *(
        KnownTest(name, "iqtt", truth, rows, command, purpose, pictures)
        for start, (purpose, rows, command) in _QUESTIONS.items()
        for name, (truth, pictures) in _DIGESTS.items()
        if name.startswith(f"{start}/")
    ),
    *(
        KnownTest(name, "rooms", digest, rows, f"scenegen render {options}", superseded=True)
        for name, rows, digest, options in _SUPERSEDED
    ),
)


def known_test(digest: str) -> KnownTest | None:
    """Return the test set of this digest, if it is known."""
    return next((test for test in KNOWN_TESTS if test.digest == digest), None)


def sets() -> dict[str, list[KnownTest]]:
    """Return the files of each set that can be made, by its name."""
    found: dict[str, list[KnownTest]] = {}
    for test in KNOWN_TESTS:
        if not test.superseded:
            found.setdefault(test.name.partition("/")[0], []).append(test)
    return found
