#include "duet/rows/groups/database.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>

#include "duet/core/require.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr const char* kTables = R"sql(
CREATE TABLE metrics (
  key TEXT NOT NULL REFERENCES episodes(key), name TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY (key, name));
CREATE TABLE tags (
  key TEXT NOT NULL REFERENCES episodes(key), name TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY (key, name));
CREATE TABLE forces (
  key TEXT NOT NULL REFERENCES episodes(key), name TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY (key, name));
CREATE TABLE contacts (
  key TEXT NOT NULL REFERENCES episodes(key), number INTEGER NOT NULL, {}, PRIMARY KEY (key, number));
CREATE TABLE verdicts (
  key TEXT NOT NULL REFERENCES episodes(key), {}, PRIMARY KEY (key, version, thresholds));
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

// Calls use(name, column as SQL declares it, value) for each member that is a column; lists and mappings have tables of
// their own.
template <JsonMapping Part, typename Use>
void each_column(const Part& part, const Use& use) {
  for (const JsonKey<Part>& key : json_schema<Part>())
    if (!key.column.empty()) use(key.name, key.column, key.write(part));
}

// Passes on one field of a row: as it is, or as a column for each member.
template <typename Use>
void each_column(const RowField& field, const EpisodeRow& row, const Use& use) {
  if (field.use.heavy) return;
  // Also where only the outcome says so.
  if (field.name == "fell") return use(field.name, field.column, row.fell || row.outcome == Outcome::kFell);
  if (!field.column.empty()) use(field.name, field.column, field.write(row));
  if (field.type == "object") {
    const std::string prefix(field.use.columns.empty() ? std::string_view(field.name) : field.use.columns);
    const nlohmann::json part = field.write(row);
    for (const JsonDoc& member : field.members) use(prefix + "_" + member.name, member.column, part.at(member.name));
  }
  if (field.name == "success") use("headline", "INTEGER NOT NULL", headline_success(row));
}

template <typename Use>
void each_column(const EpisodeRow& row, const Use& use) {
  for (const RowField& field : row_fields()) each_column(field, row, use);
}

// Columns of a table as SQL declares them, in their order.
class DeclaredColumns {
 public:
  void operator()(const std::string& name, const std::string& column, const nlohmann::json&) {
    declared_.push_back(fmt::format("{} {}", name, name == "key" ? "TEXT PRIMARY KEY" : column));
  }
  [[nodiscard]] std::string text() const { return fmt::format("{}", fmt::join(declared_, ", ")); }

 private:
  std::vector<std::string> declared_;
};

std::string schema_sql() {
  DeclaredColumns episodes, contacts, verdicts;
  each_column(EpisodeRow(), std::ref(episodes));
  each_column(RowContact(), std::ref(contacts));
  each_column(Verdict(), std::ref(verdicts));
  return fmt::format("CREATE TABLE episodes ({});", episodes.text()) +
         fmt::format(fmt::runtime(kTables), contacts.text(), verdicts.text());
}

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

  void execute(const std::string& sql) { check(sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr)); }

  // The statement that inserts a row into a table: a parameter for each of its columns.
  StatementHandle insertion(const std::string& table) {
    const int columns = sqlite3_column_count(prepare(fmt::format("SELECT * FROM {}", table)).get());
    const std::vector<std::string> marks(columns, "?");
    return prepare(fmt::format("INSERT INTO {} VALUES ({})", table, fmt::join(marks, ",")));
  }

  void step(sqlite3_stmt* statement) {
    if (sqlite3_step(statement) != SQLITE_DONE) fail(shown_path_, sqlite3_errmsg(database_.get()));
    check(sqlite3_reset(statement));
  }

 private:
  StatementHandle prepare(const std::string& sql) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &statement, nullptr));
    return StatementHandle(statement);
  }
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

  Parameters& add(const std::string& value) {
    sqlite3_bind_text(statement_, ++place_, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT);
    return *this;
  }
  Parameters& add(std::int64_t value) {
    sqlite3_bind_int64(statement_, ++place_, value);
    return *this;
  }
  Parameters& add(double value) {  // NULL where it is not finite
    std::isfinite(value) ? sqlite3_bind_double(statement_, ++place_, value) : sqlite3_bind_null(statement_, ++place_);
    return *this;
  }
  // The value of a column.
  Parameters& add(const nlohmann::json& value) {
    if (value.is_null()) return add(std::numeric_limits<double>::quiet_NaN());
    if (value.is_string()) return add(value.get_ref<const std::string&>());
    if (value.is_number_float()) return add(value.get<double>());
    if (value.is_number_unsigned()) return add(fmt::format("{}", value.get<std::uint64_t>()));
    return add(value.is_boolean() ? std::int64_t{value.get<bool>()} : value.get<std::int64_t>());
  }
  Parameters& add(const char* value) { return add(std::string(value)); }

 private:
  sqlite3_stmt* statement_;
  int place_ = 0;
};

class RowWriter {
 public:
  explicit RowWriter(Database& database)
      : database_(database),
        episode_(database.insertion("episodes")),
        metric_(database.insertion("metrics")),
        force_(database.insertion("forces")),
        tag_(database.insertion("tags")),
        contact_(database.insertion("contacts")),
        verdict_(database.insertion("verdicts")),
        value_(database.insertion("verdict_values")) {}

  void write(const EpisodeRow& row) {
    write_episode(row);
    write_finite(row.key, row.metrics, metric_.get());
    write_finite(row.key, row.forces, force_.get());
    for (const auto& [name, value] : row.tags.map()) {
      Parameters(tag_.get()).add(row.key).add(name).add(value);
      database_.step(tag_.get());
    }
    write_contacts(row);
    for (const Verdict& verdict : row.verdicts) write_verdict(row.key, verdict);
  }

 private:
  // Adds what a column holds.
  static auto into(Parameters& parameters) {
    return
        [&parameters](const std::string&, const std::string&, const nlohmann::json& value) { parameters.add(value); };
  }

  void write_episode(const EpisodeRow& row) {
    Parameters parameters(episode_.get());
    each_column(row, into(parameters));
    database_.step(episode_.get());
  }

  void write_finite(const std::string& key, const NamedNumbers& values, sqlite3_stmt* statement) {
    for (const auto& [name, value] : values) {
      if (!std::isfinite(value)) continue;
      Parameters(statement).add(key).add(name).add(value);
      database_.step(statement);
    }
  }

  void write_contacts(const EpisodeRow& row) {
    int number = 0;
    for (const RowContact& contact : row.contacts) {
      Parameters parameters(contact_.get());
      parameters.add(row.key).add(std::int64_t{number++});
      each_column(contact, into(parameters));
      database_.step(contact_.get());
    }
  }

  void write_verdict(const std::string& key, const Verdict& verdict) {
    Parameters parameters(verdict_.get());
    parameters.add(key);
    each_column(verdict, into(parameters));
    database_.step(verdict_.get());
    const auto write = [&](const char* kind, const std::string& name, double value) {
      Parameters(value_.get()).add(key).add(verdict.version).add(verdict.thresholds).add(kind).add(name).add(value);
      database_.step(value_.get());
    };
    for (const auto& [name, holds] : verdict.parts) write("part", name, holds ? 1.0 : 0.0);
    for (const auto& [name, value] : verdict.values) write("value", name, value);
    for (const auto& [name, value] : verdict.margins) write("margin", name, value);
  }

  Database& database_;
  StatementHandle episode_, metric_, force_, tag_, contact_, verdict_, value_;
};

void write_notes(const std::vector<std::string>& notes, Database& database) {
  const StatementHandle insert = database.insertion("notes");
  for (const std::string& note : notes) {
    Parameters(insert.get()).add(note);
    database.step(insert.get());
  }
}

void fill(const std::vector<EpisodeRow>& rows, const std::vector<std::string>& notes, const std::string& file,
          const std::string& shown_path) {
  Database database(file, shown_path);
  database.execute("PRAGMA foreign_keys = ON; BEGIN");
  database.execute(schema_sql());
  {
    RowWriter writer(database);
    for (const EpisodeRow* row : in_episode_order(rows)) writer.write(*row);
  }
  write_notes(notes, database);
  database.execute("COMMIT");
}

}  // namespace

std::vector<std::string> database_columns(const RowField& field) {
  std::vector<std::string> names;
  each_column(field, EpisodeRow(),
              [&](const std::string& name, const std::string&, const nlohmann::json&) { names.push_back(name); });
  return names;
}

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

namespace {

RowFieldInfo described(const JsonDoc& known) {
  const std::string unit = known.unit.empty() ? "" : fmt::format(" [{}]", known.unit);
  RowFieldInfo info = {known.name, known.type, known.meaning + unit, {}, {}};
  for (const JsonDoc& member : known.members) info.members.push_back(described(member));
  return info;
}

}  // namespace

std::vector<RowFieldInfo> row_field_list() {
  std::vector<RowFieldInfo> list = {
      {"schema", "integer", fmt::format("{}, the only one that is read", kRowSchema), {}, {}}};
  for (const RowField& field : row_fields()) {
    RowFieldInfo& info = list.emplace_back(described(field));
    if (!field.use.repeats) info.meaning += "; differs from run to run";
    if (field.use.heavy) info.meaning += "; null in published rows";
    info.columns = database_columns(field);
  }
  return list;
}

}  // namespace duet
