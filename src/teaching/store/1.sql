-- Times are milliseconds since 1970.
CREATE TABLE set_change (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    set_name TEXT NOT NULL,
    at INTEGER NOT NULL,
    who TEXT NOT NULL,
    action TEXT NOT NULL,
    text TEXT NOT NULL,
    -- How many frames it touches.
    frames INTEGER NOT NULL,
    -- What moves where, as JSON, in the data directory.
    moves TEXT NOT NULL,
    -- begun, done, undoing, undone.
    state TEXT NOT NULL
) STRICT;
CREATE INDEX set_change_of ON set_change (set_name, id);

CREATE TABLE training (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    -- The whole training as the API tells it, without what changes while it runs.
    info TEXT NOT NULL
) STRICT;

CREATE TABLE inbox_frame (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at INTEGER NOT NULL,
    robot TEXT,
    room TEXT NOT NULL,
    -- The file's name: its content.
    content TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    -- Separated by commas, with one at both ends.
    reasons TEXT NOT NULL,
    value REAL NOT NULL,
    is_labeled INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    -- The rest as the API tells it.
    info TEXT NOT NULL
) STRICT;
CREATE INDEX inbox_by_value ON inbox_frame (is_labeled, value DESC, id DESC);
CREATE INDEX inbox_by_content ON inbox_frame (content);

CREATE TABLE audit (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at INTEGER NOT NULL,
    who TEXT NOT NULL,
    what TEXT NOT NULL,
    target TEXT NOT NULL,
    detail TEXT NOT NULL
) STRICT;

CREATE TABLE made_key (
    name TEXT PRIMARY KEY,
    -- role:name:hash or role:name:hash:robot+robot.
    line TEXT NOT NULL,
    at INTEGER NOT NULL
) STRICT;

-- What people have set here, as JSON.
CREATE TABLE rule (
    name TEXT PRIMARY KEY,
    value TEXT NOT NULL
) STRICT;
