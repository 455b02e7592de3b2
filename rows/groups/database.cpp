#include "duet/rows/groups/database.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cmath>
#include <concepts>
#include <filesystem>
#include <functional>
#include <memory>
#include <type_traits>
#include <variant>

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

template <typename T, typename... Types>
concept OneOf = (std::same_as<T, Types> || ...);

template <typename T>
concept ColumnValue = OneOf<T, std::string, int, long, std::uint64_t, double, bool, std::optional<bool>, Outcome>;

// Calls use(name, value) for each member that is a column; lists and mappings have tables of their own.
template <RowPart Part, typename Use>
void each_column(const Part& part, const std::string& prefix, const Use& use) {
  for (const JsonMember<Part>& known : part_members<Part>())
    std::visit(
        [&](auto member) {
          if constexpr (ColumnValue<std::remove_cvref_t<decltype(part.*member)>>)
            use(prefix + std::string(known.name), part.*member);
        },
        known.member);
}

// Passes on one field of a row: as it is, or as a column for each member.
template <typename Use>
void each_column(const RowField& field, const EpisodeRow& row, const Use& use) {
  const std::string name(field.json.name);
  if (field.use.heavy) return;
  // Also where only the outcome says so.
  if (name == "fell") return use(name, row.fell || row.outcome == Outcome::kFell);
  std::visit(
      [&](auto member) {
        using Value = std::remove_cvref_t<decltype(row.*member)>;
        if constexpr (ColumnValue<Value>) use(name, row.*member);
        if constexpr (RowPart<Value>)
          each_column(row.*member, (field.use.columns.empty() ? name : std::string(field.use.columns)) + "_", use);
      },
      field.json.member);
  if (name == "success") use("headline", headline_success(row));
}

template <typename Use>
void each_column(const EpisodeRow& row, const Use& use) {
  for (const RowField& field : row_fields()) each_column(field, row, use);
}

template <ColumnValue Value>
constexpr const char* sql_type() {
  // A seed has 64 bits without a sign, more than SQLite's integers hold.
  if constexpr (OneOf<Value, std::string, Outcome, std::uint64_t>) return "TEXT NOT NULL";
  if constexpr (std::same_as<Value, double>) return "REAL";
  if constexpr (std::same_as<Value, std::optional<bool>>) return "INTEGER";
  return "INTEGER NOT NULL";
}

// Columns of a table as SQL declares them, in their order.
class DeclaredColumns {
 public:
  template <ColumnValue Value>
  void operator()(const std::string& name, const Value&) {
    declared_.push_back(fmt::format("{} {}", name, name == "key" ? "TEXT PRIMARY KEY" : sql_type<Value>()));
  }
  [[nodiscard]] std::string text() const { return fmt::format("{}", fmt::join(declared_, ", ")); }

 private:
  std::vector<std::string> declared_;
};

std::string schema_sql() {
  DeclaredColumns episodes, contacts, verdicts;
  each_column(EpisodeRow(), std::ref(episodes));
  each_column(RowContact(), "", std::ref(contacts));
  each_column(Verdict(), "", std::ref(verdicts));
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
  Parameters& add(int value) { return add(std::int64_t{value}); }
  Parameters& add(bool value) { return add(std::int64_t{value ? 1 : 0}); }
  Parameters& add(std::uint64_t value) { return add(fmt::format("{}", value)); }
  Parameters& add(Outcome value) { return add(std::string(to_string(value))); }
  Parameters& add(double value) {  // NULL where it is not finite
    std::isfinite(value) ? sqlite3_bind_double(statement_, ++place_, value) : sqlite3_bind_null(statement_, ++place_);
    return *this;
  }
  Parameters& add(const std::optional<bool>& value) {
    value.has_value() ? sqlite3_bind_int(statement_, ++place_, *value ? 1 : 0)
                      : sqlite3_bind_null(statement_, ++place_);
    return *this;
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
    return [&parameters](const std::string&, const auto& value) { parameters.add(value); };
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
      parameters.add(row.key).add(number++);
      each_column(contact, "", into(parameters));
      database_.step(contact_.get());
    }
  }

  void write_verdict(const std::string& key, const Verdict& verdict) {
    Parameters parameters(verdict_.get());
    parameters.add(key);
    each_column(verdict, "", into(parameters));
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
  each_column(field, EpisodeRow(), [&](const std::string& name, const auto&) { names.push_back(name); });
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

template <typename Owner, typename... More>
RowFieldInfo described(const JsonMember<Owner, More...>& known) {
  const std::string unit = known.unit.empty() ? "" : fmt::format(" [{}]", known.unit);
  return {std::string(known.name), std::string(member_words(known)), std::string(known.meaning) + unit, {}, {}};
}

template <RowPart Part>
std::vector<RowFieldInfo> members_of(ValueType<Part>) {
  std::vector<RowFieldInfo> members;
  for (const JsonMember<Part>& known : part_members<Part>()) members.push_back(described(known));
  return members;
}
template <RowPart Part>
std::vector<RowFieldInfo> members_of(ValueType<std::vector<Part>>) {
  return members_of(ValueType<Part>());
}
template <typename Value>
std::vector<RowFieldInfo> members_of(ValueType<Value>) {
  return {};
}

}  // namespace

std::vector<RowFieldInfo> row_field_list() {
  std::vector<RowFieldInfo> list = {
      {"schema", "integer", fmt::format("{}, the only one that is read", kRowSchema), {}, {}}};
  for (const RowField& field : row_fields()) {
    RowFieldInfo& info = list.emplace_back(described(field.json));
    if (!field.use.repeats) info.meaning += "; differs from run to run";
    if (field.use.heavy) info.meaning += "; null in published rows";
    info.columns = database_columns(field);
    info.members = std::visit([]<typename Value>(Value EpisodeRow::*) { return members_of(ValueType<Value>()); },
                              field.json.member);
  }
  return list;
}

}  // namespace duet
