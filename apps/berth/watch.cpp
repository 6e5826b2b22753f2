// `berth watch`: reads values by SDO again and again, and shows them by name, with their age and a small plot.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "ask.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "keyboard.hpp"
#include "live_values.hpp"
#include "machine_file.hpp"
#include "redraw.hpp"
#include "request_verb.hpp"
#include "single.hpp"
#include "verbs.hpp"
#include "watched.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

struct WatchOptions {
  std::vector<std::string> words;
  std::chrono::nanoseconds every = 1s;
  unsigned count = 0;  // 0: until the user ends it
};

/// The output of the readings.
class Shown {
 public:
  virtual ~Shown() = default;
  virtual void reading(const Reading& reading, rt::Time since_begin) = 0;
  /// Called between two rounds, too.
  virtual void draw(rt::Time) {}
  /// The user has ended it by a key.
  [[nodiscard]] virtual bool ended() const { return false; }
};

/// One line per reading, as text or as JSON.
class Lines final : public Shown {
 public:
  Lines(const Watched& watched, bool json) : watched_(watched), json_(json) {}
  void reading(const Reading& reading, rt::Time at) override {
    const double seconds = std::chrono::duration<double>(at.time_since_epoch()).count();
    if (json_) {
      nlohmann::ordered_json json{{"at_s", std::round(seconds * 1000) / 1000}};
      json.update(nlohmann::ordered_json::parse(reading.json));
      return print_text(json.dump());
    }
    const WatchRow& row = watched_.rows()[reading.row];
    print_line(fmt::format("{:9.3f} s  {}  {}", seconds, watched_.word(reading.row),
                           row.trouble.empty() ? row.value : row.trouble));
  }

 private:
  const Watched& watched_;
  bool json_;
};

/// A table that is redrawn in place.
class Table final : public Shown {
 public:
  Table(const Watched& watched, std::string headline, io::Loop& loop)
      : watched_(watched), headline_(std::move(headline)), utf8_(terminal_has_utf8()) {
    errors_.emplace([this](const std::string& line) { above_.push_back(line); });
    if (!someone_types()) return;
    keyboard_ = std::make_unique<Keyboard>(
        loop, [this](Key key) { move(key); }, [](const std::string&) {}, [] {}, [this](char key) { return take(key); });
  }
  ~Table() override {
    errors_.reset();
    for (const auto& line : above_) print_error(line);
  }
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;
  void reading(const Reading&, rt::Time) override {}
  void draw(rt::Time now) override {
    const BoardSize size = terminal_size();
    if (keyboard_ && keyboard_->take_again()) redraw_.keep();
    auto rows = watch_lines(watched_.rows(), size.columns, now, utf8_);
    std::vector<BoardLine> lines{{text::cut(text::one_line(headline_), size.columns), false}};
    lines.push_back(rows.front());
    rows.erase(rows.begin());
    const std::size_t room = size.rows > 4 ? size.rows - 4 : 1;  // without headings, cursor, and "rows … of …"
    const bool partial = rows.size() > room;
    first_ = partial ? std::clamp<std::ptrdiff_t>(first_, 0, static_cast<std::ptrdiff_t>(rows.size() - room)) : 0;
    const std::size_t shown = std::min(rows.size(), room);
    for (std::size_t i = 0; i < shown; ++i) lines.push_back(std::move(rows[static_cast<std::size_t>(first_) + i]));
    if (partial) {
      lines.push_back({text::cut(fmt::format("rows {} to {} of {}: Up, Down", first_ + 1,
                                             static_cast<std::size_t>(first_) + shown, rows.size()),
                                 size.columns),
                       false});
    }
    redraw_.draw(std::exchange(above_, {}), std::move(lines), size);
  }
  [[nodiscard]] bool ended() const override { return ended_; }

 private:
  void move(Key key) {
    constexpr std::ptrdiff_t page = 10;
    switch (key) {
      case Key::up: --first_; break;
      case Key::down: ++first_; break;
      case Key::page_up: first_ -= page; break;
      case Key::page_down: first_ += page; break;
      case Key::home: first_ = 0; break;
      case Key::end: first_ = static_cast<std::ptrdiff_t>(watched_.rows().size()); break;
    }
  }
  // Takes every key, since the user types no lines here.
  bool take(char key) {
    if (key == 'q') ended_ = true;
    if (key == '?') {
      above_ = {"q or Ctrl-C ends it; Up, Down, Page Up, Page Down, Home and End move the rows",
                "age: since the value was read; plot: the last values, from lowest to highest"};
    }
    return true;
  }

  const Watched& watched_;
  std::string headline_;
  bool utf8_;
  Redraw redraw_;
  std::vector<std::string> above_;
  std::ptrdiff_t first_ = 0;
  bool ended_ = false;
  std::unique_ptr<Keyboard> keyboard_;
  std::optional<ErrorLines> errors_;  // error lines are shown above the table
};

/// One watch: rounds, and the time between them.
class Watch {
 public:
  Watch(const Conversation& talk, Watched& watched, Shown& shown, const Options& options, const WatchOptions& how)
      : talk_(talk), watched_(watched), shown_(shown), options_(options), how_(how), begin_(talk.now()) {}

  int run() {
    for (unsigned rounds = 1;; ++rounds) {
      const rt::Time began = talk_.now();
      if (const auto bad = round()) return *bad;
      draw();
      const bool enough = how_.count > 0 && rounds >= how_.count;
      if (enough || !rest(began + how_.every)) break;
    }
    const auto unread = [](const WatchRow& row) { return !row.read_at; };
    return std::ranges::any_of(watched_.rows(), unread) ? Exit::no : Exit::done;
  }

 private:
  // Makes one round; returns the exit status if the watch cannot go on.
  std::optional<int> round() {
    const auto& requests = watched_.requests();
    for (std::size_t i = 0; i < requests.size() && !over(); ++i) {
      const auto reply = talk_.ask(requests[i], [this] { return goes_on(); });
      if (!reply && (over() || !talk_.wait(0ns))) return std::nullopt;
      if (!reply) return tell(reply.error(), options_.json);
      const rt::Time now = talk_.now();
      if (reply->status == Exit::usage) return tell({Exit::usage, reply->error, reply->json}, options_.json);
      for (const auto& reading : watched_.take(i, *reply, now)) {
        shown_.reading(reading, rt::Time(now - begin_));
        if (run_must_end()) return std::nullopt;
      }
    }
    return std::nullopt;
  }
  [[nodiscard]] bool over() const {
    const bool late = options_.timeout && talk_.now() - begin_ >= *options_.timeout;
    return late || run_must_end() || shown_.ended();
  }
  // Called while an answer is awaited: draws the ages and takes keys.
  [[nodiscard]] bool goes_on() {
    if (talk_.now() >= drawn_ + draw_period) draw();
    return !over();
  }
  void draw() {
    drawn_ = talk_.now();
    shown_.draw(drawn_);
  }
  // Waits until the next round; meanwhile draws the ages and takes keys. False: the watch is over.
  bool rest(rt::Time until) {
    do {
      const rt::Duration left = std::max<rt::Duration>(until - talk_.now(), 0ns);
      if (over() || !talk_.wait(std::min(left, draw_period))) return false;
      draw();
    } while (talk_.now() < until);
    return !over();
  }

  const Conversation& talk_;
  Watched& watched_;
  Shown& shown_;
  const Options& options_;
  static constexpr rt::Duration draw_period = 250ms;
  const WatchOptions& how_;
  rt::Time begin_;
  rt::Time drawn_ = begin_;
};

// If the user names only another process's socket, this process does not know the machine's names.
tl::expected<design::Machine, Failure> known_machine(const Options& options) {
  const bool named = !options.machine.empty() || !options.ports.empty();
  return named ? machine_of(options) : design::Machine();
}

int run_watch(const Options& given, const WatchOptions& how) {
  Options options = given;
  options.machine = default_machine(options);
  const auto machine = known_machine(options);
  if (!machine) return tell(machine.error(), options.json);
  const auto words = how.words.empty() ? watch_words(*machine) : how.words;
  if (words.empty()) {
    return tell(failure(Exit::usage,
                        "name what to watch: SLOT/OBJECT, such as left/1001h; or write watch = "
                        "[\"left/1001h\"] into [machine]"),
                options.json);
  }
  const bool bus_alone = options.machine.empty() && !options.ports.empty();
  auto watched = Watched::of(*machine, bus_alone ? std::string() : options.bus, words);
  if (!watched) return tell(failure(Exit::usage, watched.error()), options.json);
  const bool live = !options.json && can_draw();
  options.sim.pace = options.sim.pace || live;
  const auto talk = [&](const Conversation& talk) {
    const std::string headline =
        fmt::format("{}  every {}  q ends it, ? helps", machine->name.empty() ? options.control : machine->name,
                    text::write_duration(how.every));
    std::unique_ptr<Shown> shown;
    if (live && talk.loop != nullptr) shown = std::make_unique<Table>(*watched, headline, *talk.loop);
    if (!shown) shown = std::make_unique<Lines>(*watched, options.json);
    return Watch(talk, *watched, *shown, options, how).run();
  };
  const auto done = converse(options, watched->requests().front(), talk);
  return done ? *done : tell(done.error(), options.json);
}

}  // namespace

void add_watch(Verb& berth, Options& options) {
  const auto how = std::make_shared<WatchOptions>();
  const Verb watch = berth.add("watch", "values by name: a live table with plots, or a line for each reading",
                               [&options, how] { return run_watch(options, *how); });
  bus_words(watch, options, {.machine = {.confirms = false, .sends = false}});
  watch
      .word("object", how->words,
            "a node and one of its objects, as sdo read takes them: left/1001h, 5/6041h, \"left/Error register\", or a "
            "network variable by its name (default: watch = of the machine file)")
      .shown("SLOT/OBJECT...");
  colour_word(watch);
  watch.time("--every", how->every, "time between the starts of two readings of all objects (default: 1 s)");
  watch.word("--count", how->count, "end after this number of readings of all objects (default: until q or Ctrl-C)")
      .from_to(1, 1'000'000'000);
  watch.footer(
      "Examples:\n  berth watch drive/6041h drive/Statusword -m machine.toml\n"
      "  berth watch machine.toml unloader/total unloader/speed --every \"200 ms\"\n"
      "  berth watch 5/1001h --port can0 --count 10 --json\n"
      "Exit status: 1 when an object could not be read at all.");
}

}  // namespace berth::cli
