#include "berth/script/lua.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include "berth/script/prelude.hpp"

namespace berth::script {
namespace {

constexpr int counted_at_once = 100;
constexpr std::size_t caught_error = 100;        // instructions: an exception, and the search for names in it
constexpr std::size_t longest_complaint = 1000;  // bytes: it goes to a terminal
constexpr const char* prelude_name = "=berth";

/// Gives the compiler the text byte by byte, so that its position is known.
struct Reader {
  std::string_view text;
  std::size_t at = 0;
  static const char* next(lua_State* state, void* self, std::size_t* size) {
    auto& reader = *static_cast<Reader*>(self);
    if (!Lua::of(state).meter().compile_byte()) luaL_error(state, "the compiler was ended");
    if (reader.at >= reader.text.size()) return nullptr;
    *size = 1;
    return reader.text.data() + reader.at++;
  }
};

/// "belt.lua:3: text" without the place.
std::string without_place(std::string text, int& line) {
  const auto end = text.find(": ");
  if (end == std::string::npos) return text;
  const auto colon = text.rfind(':', end - 1);
  if (colon == std::string::npos || colon + 1 == end) return text;
  const std::string digits = text.substr(colon + 1, end - colon - 1);
  if (digits.find_first_not_of("0123456789") != std::string::npos) return text;
  if (line == 0) line = std::atoi(digits.c_str());
  return text.substr(end + 2);
}

/// The column, from 1, of an error. The compiler has read one byte beyond the word that it reports.
int column_of(std::string_view text, std::size_t read, std::string_view complaint) {
  std::size_t at = read == 0 ? 0 : read - 1;
  if (complaint.ends_with("near <eof>")) at = read;
  const auto near = complaint.rfind("near '");
  if (near != std::string_view::npos) {
    const auto word = complaint.substr(near + 6, complaint.size() - near - 7);
    const auto found = text.substr(0, read).rfind(word);
    if (!word.empty() && found != std::string_view::npos) at = found;
  }
  const auto newline = at == 0 ? std::string_view::npos : text.rfind('\n', at - 1);
  return static_cast<int>(newline == std::string_view::npos ? at + 1 : at - newline);
}

int table_without(lua_State* state, const char* library, const char* const* names, const char* const* end) {
  lua_getglobal(state, library);
  for (; names != end; ++names) {
    lua_pushnil(state);
    lua_setfield(state, -2, *names);
  }
  lua_pop(state, 1);
  return 0;
}

}  // namespace

int current_line(lua_State* state) {
  lua_Debug record{};
  for (int level = 0; lua_getstack(state, level, &record) != 0; ++level) {
    lua_getinfo(state, "Sl", &record);
    if (record.currentline > 0 && std::strcmp(record.source, prelude_name) != 0) return record.currentline;
  }
  return 0;
}

Lua::Lua(const Limits& limits, Random random, void* owner, std::function<bool()> must_end)
    : limits_(limits),
      meter_(limits, std::move(must_end)),
      random_(random),
      owner_(owner),
      state_(lua_newstate(&Lua::allocate, this)) {
  if (!state_) return;
  *static_cast<Lua**>(lua_getextraspace(state())) = this;
  meter_.find_stack();
  const bool grown = lua_checkstack(state(), 2 * LUA_MINSTACK + 10) != 0;
  meter_.stack_known();
  lua_sethook(state(), &Lua::count, LUA_MASKCOUNT, counted_at_once);
  lua_pushcfunction(state(), &Lua::open);
  good_ = grown && lua_pcall(state(), 0, 0, 0) == LUA_OK;
  meter_.bind();
}

Lua::~Lua() { meter_.release(); }

int Lua::open(lua_State* state) {
  luaL_requiref(state, LUA_GNAME, luaopen_base, 1);
  luaL_requiref(state, LUA_STRLIBNAME, luaopen_string, 1);
  luaL_requiref(state, LUA_TABLIBNAME, luaopen_table, 1);
  luaL_requiref(state, LUA_MATHLIBNAME, luaopen_math, 1);
  lua_settop(state, 0);
  // Removes access to files and to other code, and what runs long without an instruction (patterns) or differs from run
  // to run.
  static constexpr const char* base[] = {"dofile",         "loadfile", "load",   "require",
                                         "collectgarbage", "print",    "xpcall", "warn"};
  static constexpr const char* text[] = {"dump", "find", "match", "gmatch", "gsub"};
  static constexpr const char* math[] = {"randomseed"};
  table_without(state, LUA_GNAME, std::begin(base), std::end(base));
  table_without(state, LUA_STRLIBNAME, std::begin(text), std::end(text));
  table_without(state, LUA_MATHLIBNAME, std::begin(math), std::end(math));
  lua_pushcfunction(state, &Lua::protect);
  lua_setglobal(state, "pcall");
  lua_getglobal(state, LUA_MATHLIBNAME);
  lua_pushcfunction(state, &Lua::draw);
  lua_setfield(state, -2, "random");
  lua_settop(state, 0);
  if (luaL_loadbufferx(state, prelude, std::strlen(prelude), prelude_name, "t") != LUA_OK) return lua_error(state);
  lua_call(state, 0, 0);
  lua_pushliteral(state, "error in error handling");  // otherwise Lua makes it where no error may occur
  luaL_ref(state, LUA_REGISTRYINDEX);
  return 0;
}

void Lua::begin() noexcept {
  meter_.begin();
  lines_ = 0;
  line_ = 0;
}

// For a new block, Lua passes its kind instead of a size.
void* Lua::allocate(void* self, void* old, std::size_t old_size, std::size_t size) noexcept {
  auto& lua = *static_cast<Lua*>(self);
  void* const fresh = lua.meter_.allocate(old, old_size, size, old == nullptr && old_size == LUA_TSTRING);
  if (fresh == nullptr && size > 0 && lua.good_) lua.note_line();
  return fresh;
}

void Lua::count(lua_State* state, lua_Debug*) {
  Lua& lua = of(state);
  if (lua.meter_.run(counted_at_once)) return;
  lua.note_line();
  lua_pushnil(state);  // `failure` has the reason
  lua_error(state);
}

// Notes the script's current line. While Lua unwinds after an error, there is none.
void Lua::note_line() noexcept {
  const int line = current_line(state());
  if (line > 0) line_ = line;
}

int Lua::explain(lua_State* state) {
  Lua& lua = of(state);
  if (lua.meter_.over() && lua.line_ != 0) return 1;  // where the call was ended, not where that was caught
  lua.line_ = 0;
  lua.note_line();
  if (lua_type(state, 1) == LUA_TSTRING || lua_type(state, 1) == LUA_TNUMBER) return 1;
  lua_pushfstring(state, "an error that is not a text but a %s", luaL_typename(state, 1));
  return 1;
}

// A script must not catch the end of a call (instructions, memory): it would run forever.
int Lua::protect(lua_State* state) {
  luaL_checkany(state, 1);
  const int status = lua_pcall(state, lua_gettop(state) - 1, LUA_MULTRET, 0);
  Meter& meter = of(state).meter_;
  if (status != LUA_OK && (status == LUA_ERRMEM || meter.over())) return lua_error(state);
  if (status != LUA_OK) meter.charge(caught_error);
  lua_pushboolean(state, status == LUA_OK ? 1 : 0);
  lua_insert(state, 1);
  return lua_gettop(state);
}

int Lua::draw(lua_State* state) {
  Random& random = of(state).random_;
  const int given = lua_gettop(state);
  if (given == 0) {
    lua_pushnumber(state, static_cast<double>(random.next() >> 11U) * 0x1p-53);
    return 1;
  }
  const auto low = given == 1 ? 1 : luaL_checkinteger(state, 1);
  const auto high = luaL_checkinteger(state, given == 1 ? 1 : 2);
  if (high < low) return luaL_error(state, "math.random: the range is empty");
  lua_pushinteger(state, random.between(low, high));
  return 1;
}

std::string Lua::why_so_few() const {
  if (meter_.weight() == 1) return {};
  const auto of_text = static_cast<std::int64_t>(meter_.longest_text() / Meter::bytes_of_text);
  const auto cause = 2 * of_text >= meter_.weight()
                         ? fmt::format("a text of {} bytes; make shorter ones", meter_.longest_text())
                         : std::string("many values or calls in each other at once; have fewer");
  return fmt::format(" (each counts {} times because of {})", meter_.weight(), cause);
}

std::string Lua::why(Meter::End end) const {
  switch (end) {
    case Meter::End::instructions:
      return fmt::format("the call took more than {} instructions{}", limits_.instructions, why_so_few());
    case Meter::End::memory: return fmt::format("the script wants more than {} KiB of memory", limits_.memory / 1024);
    case Meter::End::block:
      return fmt::format("the script wants more than {} KiB in one piece: a shorter text or a smaller table will do",
                         limits_.block / 1024);
    case Meter::End::processor:
      return fmt::format("one call took more than {} s of this computer's processor: let it do less",
                         std::chrono::duration<double>(limits_.processor).count());
    case Meter::End::host: return "it was ended with the run";
    case Meter::End::none: break;
  }
  return "there is no memory for it";
}

Failure Lua::failure(int status) {
  std::size_t length = 0;
  const char* const text = lua_type(state(), -1) == LUA_TSTRING ? lua_tolstring(state(), -1, &length) : nullptr;
  Failure failure{line_, text == nullptr ? "an error without a text" : std::string(text, length)};
  lua_settop(state(), 0);
  const auto end = meter_.end();
  if (status == LUA_ERRMEM || meter_.over()) {
    failure.text = why(end);
  } else {
    failure.text = without_place(std::move(failure.text), failure.line);
    if (failure.text.size() > longest_complaint) failure.text.resize(longest_complaint);
  }
  if (end == Meter::End::processor) failure.kind = Message::Kind::overran;
  if (end == Meter::End::host) failure.kind = Message::Kind::ended;
  return failure;
}

std::optional<Failure> Lua::compile(const Script& script) {
  begin();
  Reader reader{script.text};
  const std::string name = "=" + script.file;
  const int status = lua_load(state(), &Reader::next, &reader, name.c_str(), "t");
  if (status == LUA_OK) return std::nullopt;
  auto wrong = failure(status);
  column_ = column_of(script.text, reader.at, wrong.text);
  return wrong;
}

std::optional<Failure> Lua::call(int arguments) {
  begin();
  const int function = lua_gettop(state()) - arguments;
  lua_pushcfunction(state(), &Lua::explain);
  lua_insert(state(), function);
  const int status = lua_pcall(state(), arguments, 0, function);
  if (status != LUA_OK) return failure(status);
  lua_settop(state(), function - 1);
  return std::nullopt;
}

std::optional<Failure> Lua::run() { return call(0); }

int Lua::work(lua_State* state) {
  const Work& work = *static_cast<const Work*>(lua_touserdata(state, 1));
  lua_settop(state, 0);
  work(state);
  return 0;
}

std::optional<Failure> Lua::run(const Work& work) {
  lua_pushcfunction(state(), &Lua::work);
  lua_pushlightuserdata(state(), const_cast<Work*>(&work));
  return call(1);
}

std::optional<Finding> check(const Script& script) {
  Finding finding;
  finding.file = script.file;
  if (script.text.size() > longest_script) {
    finding.message = fmt::format("the script has more than {} KiB", longest_script / 1024);
    finding.fix = "shorten it";
    return finding;
  }
  Lua lua({}, Random(0), nullptr);
  if (!lua.good()) return finding.message = "there is no memory for a script", finding;
  const auto wrong = lua.compile(script);
  if (!wrong) return std::nullopt;
  finding.line = wrong->line;
  finding.column = lua.column();
  finding.message = wrong->text;
  return finding;
}

std::string to_string(const Message& told) {
  if (told.kind == Message::Kind::printed) return told.text;
  if (told.line == 0) return fmt::format("{}: {}", told.file, told.text);
  return fmt::format("{}:{}: {}", told.file, told.line, told.text);
}

}  // namespace berth::script
