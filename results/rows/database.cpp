#include "duet/results/rows/database.h"

#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "duet/core/require.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

constexpr const char* kSchemaSql = R"sql(
CREATE TABLE episodes (
  key TEXT PRIMARY KEY, suite TEXT NOT NULL, suite_version TEXT NOT NULL, suite_hash TEXT NOT NULL,
  task TEXT NOT NULL, clip TEXT NOT NULL, episode INTEGER NOT NULL, seed TEXT NOT NULL,
  engine TEXT NOT NULL, engine_version TEXT NOT NULL, engine_profile TEXT NOT NULL, profile_digest TEXT NOT NULL,
  controller TEXT NOT NULL, controller_digest TEXT NOT NULL, policy TEXT NOT NULL, policy_digest TEXT NOT NULL,
  perturbation TEXT NOT NULL, robot_digest TEXT NOT NULL, arm TEXT NOT NULL,
  outcome TEXT NOT NULL, message TEXT NOT NULL, detectors TEXT NOT NULL, success INTEGER, headline INTEGER NOT NULL,
  fell INTEGER NOT NULL, frames INTEGER NOT NULL, sim_s REAL, wall_s REAL,
  contact_peak_n REAL, contact_impulse_ns REAL, contacts_total INTEGER NOT NULL, late_plans INTEGER NOT NULL,
  faults_observations INTEGER NOT NULL, faults_actions INTEGER NOT NULL, faults_stopped INTEGER NOT NULL,
  policy_late INTEGER NOT NULL, policy_invalid INTEGER NOT NULL, policy_dead INTEGER NOT NULL,
  policy_message TEXT NOT NULL, policy_ms_p50 REAL, policy_ms_p95 REAL, policy_ms_max REAL,
  state_hash TEXT NOT NULL, started_at TEXT NOT NULL);
CREATE TABLE metrics (
  key TEXT NOT NULL REFERENCES episodes(key), name TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY (key, name));
CREATE TABLE forces (
  key TEXT NOT NULL REFERENCES episodes(key), name TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY (key, name));
CREATE TABLE contacts (
  key TEXT NOT NULL REFERENCES episodes(key), number INTEGER NOT NULL,
  link TEXT NOT NULL, region TEXT NOT NULL, capsule TEXT NOT NULL, begin_s REAL, duration_s REAL,
  peak_n REAL, impulse_ns REAL, depth_m REAL, windowed_mean_n REAL, PRIMARY KEY (key, number));
CREATE TABLE verdicts (
  key TEXT NOT NULL REFERENCES episodes(key), version TEXT NOT NULL, thresholds TEXT NOT NULL,
  success INTEGER NOT NULL, frames INTEGER NOT NULL, PRIMARY KEY (key, version, thresholds));
CREATE TABLE verdict_values (
  key TEXT NOT NULL, version TEXT NOT NULL, thresholds TEXT NOT NULL,
  kind TEXT NOT NULL CHECK (kind IN ('part', 'value', 'margin')), name TEXT NOT NULL, value REAL,
  PRIMARY KEY (key, version, thresholds, kind, name),
  FOREIGN KEY (key, version, thresholds) REFERENCES verdicts(key, version, thresholds));
CREATE TABLE notes (text TEXT NOT NULL);
CREATE VIEW leaderboard AS
  SELECT engine, controller, policy, perturbation, arm, task, COUNT(*) AS n, SUM(headline) AS k,
         AVG(headline) AS success, SUM(fell) AS fell, SUM(outcome = 'diverged') AS diverged,
         SUM(outcome = 'timeout') AS timed_out, SUM(outcome = 'error') AS errors,
         SUM(outcome = 'unsupported') AS unsupported
  FROM episodes GROUP BY engine, controller, policy, perturbation, arm, task;
)sql";

struct Close {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using DatabaseHandle = std::unique_ptr<sqlite3, Close>;
using StatementHandle = std::unique_ptr<sqlite3_stmt, Close>;

[[noreturn]] void fail(const std::string& path, const std::string& reason) {
  throw InputError(fmt::format("cannot write '{}': {}", path, reason));
}

// An SQL database in a file; every fault is an InputError that names the file that the caller asked for.
class Database {
 public:
  Database(const std::string& file, std::string shown_path) : shown_path_(std::move(shown_path)) {
    sqlite3* database = nullptr;
    const int code = sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
    database_.reset(database);
    if (code != SQLITE_OK) fail(shown_path_, sqlite3_errmsg(database));
  }

  void execute(const char* sql) { check(sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr)); }

  StatementHandle prepare(const char* sql) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(database_.get(), sql, -1, &statement, nullptr));
    return StatementHandle(statement);
  }

  void step(sqlite3_stmt* statement) {
    if (sqlite3_step(statement) != SQLITE_DONE) fail(shown_path_, sqlite3_errmsg(database_.get()));
    check(sqlite3_reset(statement));
  }

 private:
  void check(int code) {
    if (code != SQLITE_OK) fail(shown_path_, sqlite3_errmsg(database_.get()));
  }

  std::string shown_path_;
  DatabaseHandle database_;
};

// Fills the parameters of a statement from the left.
class Parameters {
 public:
  explicit Parameters(sqlite3_stmt* statement) : statement_(statement) {}

  Parameters& text(const std::string& value) {
    sqlite3_bind_text(statement_, ++place_, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT);
    return *this;
  }
  Parameters& integer(std::int64_t value) {
    sqlite3_bind_int64(statement_, ++place_, value);
    return *this;
  }
  Parameters& number(double value) {  // NULL where it is not finite
    std::isfinite(value) ? sqlite3_bind_double(statement_, ++place_, value) : sqlite3_bind_null(statement_, ++place_);
    return *this;
  }
  Parameters& optional_flag(const std::optional<bool>& value) {
    value.has_value() ? sqlite3_bind_int(statement_, ++place_, *value ? 1 : 0)
                      : sqlite3_bind_null(statement_, ++place_);
    return *this;
  }

 private:
  sqlite3_stmt* statement_;
  int place_ = 0;
};

class RowWriter {
 public:
  explicit RowWriter(Database& database)
      : database_(database),
        episode_(database.prepare(
            "INSERT INTO episodes VALUES "
            "(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)")),
        metric_(database.prepare("INSERT INTO metrics VALUES (?,?,?)")),
        force_(database.prepare("INSERT INTO forces VALUES (?,?,?)")),
        contact_(database.prepare("INSERT INTO contacts VALUES (?,?,?,?,?,?,?,?,?,?,?)")),
        verdict_(database.prepare("INSERT INTO verdicts VALUES (?,?,?,?,?)")),
        value_(database.prepare("INSERT INTO verdict_values VALUES (?,?,?,?,?,?)")) {}

  void write(const EpisodeRow& row) {
    write_episode(row);
    write_finite(row.key, row.metrics, metric_.get());
    write_finite(row.key, row.forces, force_.get());
    write_contacts(row);
    for (const Verdict& verdict : row.verdicts) write_verdict(row.key, verdict);
  }

 private:
  void write_episode(const EpisodeRow& row) {
    // The seed has 64 bits without a sign, more than SQLite's integers hold.
    Parameters(episode_.get())
        .text(row.key)
        .text(row.suite)
        .text(row.suite_version)
        .text(row.suite_hash)
        .text(row.task)
        .text(row.clip)
        .integer(row.episode)
        .text(fmt::format("{}", row.seed))
        .text(row.engine)
        .text(row.engine_version)
        .text(row.engine_profile)
        .text(row.profile_digest)
        .text(row.controller)
        .text(row.controller_digest)
        .text(row.policy)
        .text(row.policy_digest)
        .text(row.perturbation)
        .text(row.robot_digest)
        .text(row.arm)
        .text(std::string(to_string(row.outcome)))
        .text(row.message)
        .text(row.detectors)
        .optional_flag(row.success)
        .integer(headline_success(row) ? 1 : 0)
        .integer(row.fell || row.outcome == Outcome::kFell ? 1 : 0)
        .integer(row.frames)
        .number(row.sim_s)
        .number(row.wall_s)
        .number(row.contact_peak_n)
        .number(row.contact_impulse_ns)
        .integer(row.contacts_total)
        .integer(row.late_plans)
        .integer(row.faults.observations)
        .integer(row.faults.actions)
        .integer(row.faults.stopped ? 1 : 0)
        .integer(row.policy_faults.late)
        .integer(row.policy_faults.invalid)
        .integer(row.policy_faults.dead ? 1 : 0)
        .text(row.policy_faults.message)
        .number(row.policy_ms.p50)
        .number(row.policy_ms.p95)
        .number(row.policy_ms.max)
        .text(row.state_hash)
        .text(row.started_at);
    database_.step(episode_.get());
  }

  void write_finite(const std::string& key, const std::map<std::string, double>& values, sqlite3_stmt* statement) {
    for (const auto& [name, value] : values) {
      if (!std::isfinite(value)) continue;
      Parameters(statement).text(key).text(name).number(value);
      database_.step(statement);
    }
  }

  void write_contacts(const EpisodeRow& row) {
    std::int64_t number = 0;
    for (const RowContact& contact : row.contacts) {
      Parameters(contact_.get())
          .text(row.key)
          .integer(number++)
          .text(contact.link)
          .text(contact.region)
          .text(contact.capsule)
          .number(contact.begin_s)
          .number(contact.duration_s)
          .number(contact.peak_n)
          .number(contact.impulse_ns)
          .number(contact.depth_m)
          .number(contact.windowed_mean_n);
      database_.step(contact_.get());
    }
  }

  void write_verdict(const std::string& key, const Verdict& verdict) {
    Parameters(verdict_.get())
        .text(key)
        .text(verdict.version)
        .text(verdict.thresholds)
        .integer(verdict.success ? 1 : 0)
        .integer(verdict.frames);
    database_.step(verdict_.get());
    const auto write = [&](const char* kind, const std::string& name, double value) {
      Parameters(value_.get())
          .text(key)
          .text(verdict.version)
          .text(verdict.thresholds)
          .text(kind)
          .text(name)
          .number(value);
      database_.step(value_.get());
    };
    for (const auto& [name, holds] : verdict.parts) write("part", name, holds ? 1.0 : 0.0);
    for (const auto& [name, value] : verdict.values) write("value", name, value);
    for (const auto& [name, value] : verdict.margins) write("margin", name, value);
  }

  Database& database_;
  StatementHandle episode_, metric_, force_, contact_, verdict_, value_;
};

void write_notes(const std::vector<std::string>& notes, Database& database) {
  const StatementHandle insert = database.prepare("INSERT INTO notes VALUES (?)");
  for (const std::string& note : notes) {
    Parameters(insert.get()).text(note);
    database.step(insert.get());
  }
}

void fill(const std::vector<EpisodeRow>& rows, const std::vector<std::string>& notes, const std::string& file,
          const std::string& shown_path) {
  Database database(file, shown_path);
  database.execute("PRAGMA foreign_keys = ON; BEGIN");
  database.execute(kSchemaSql);
  {
    RowWriter writer(database);
    for (const EpisodeRow* row : in_episode_order(rows)) writer.write(*row);
  }
  write_notes(notes, database);
  database.execute("COMMIT");
}

}  // namespace

void write_database(const std::vector<EpisodeRow>& rows, const std::string& path,
                    const std::vector<std::string>& notes) {
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  std::error_code error;
  if (!parent.empty()) std::filesystem::create_directories(parent, error);
  if (error) fail(path, error.message());
  // A reader sees the old file or the new one, never a half-written one.
  const std::string temporary = fmt::format("{}.part-{}", path, ::getpid());
  const auto discard = [&] {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    std::filesystem::remove(temporary + "-journal", ignored);
  };
  discard();
  try {
    fill(rows, notes, temporary, path);
  } catch (...) {
    discard();
    throw;
  }
  std::filesystem::rename(temporary, path, error);
  if (error) {
    discard();
    fail(path, error.message());
  }
}

}  // namespace duet
