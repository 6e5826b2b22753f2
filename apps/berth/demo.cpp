// `berth demo`: paper 1's five slaves, from blank to operational, then its replacement story (S1.49 to S1.51).
#include "demo_data.hpp"

#include <errno.h>
#include <fmt/format.h>

#include <utility>

#include "studio_host.hpp"
#include "up.hpp"
#include "verbs.hpp"

namespace berth::cli {

namespace {

/// Explains each kind of event at its first occurrence.
class Comments {
 public:
  std::string operator()(const operate::Event& event) {
    const auto first = [](bool& told) { return !std::exchange(told, true); };
    if (event.slot.empty() && event.text == "discovered" && first(found_)) {
      return "-- All are found by their LSS addresses. Each now gets the node-ID of its slot.";
    }
    if (event.slot.empty() && event.text == "operational" && first(operational_)) {
      return "-- From blank to operational. In two seconds the plant unplugs s2 and s4.";
    }
    if (!event.slot.empty() && event.text.starts_with("absent") && first(lost_)) {
      return "-- Its heartbeat stopped. This machine file lets a new device take its place.";
    }
    if (lost_ && !event.slot.empty() && event.text.starts_with("bound to") && first(replaced_)) {
      return "-- A new device was plugged in, and has the node-ID of the one that left.";
    }
    return {};
  }

 private:
  bool found_ = false;
  bool operational_ = false;
  bool lost_ = false;
  bool replaced_ = false;
};

Story story() {
  return {
      {"-- Five devices without node-IDs on a simulated bus, those of paper 1.",
       "-- Berth finds them, gives each its node-ID, and starts them."},
      Comments(),
      {"-- Next: examples/five-slaves.toml is this machine, five-slaves.plant.toml its",
       "-- devices. Change a serial number, unplug one, and try:",
       fmt::format("  {} up examples/five-slaves.toml --sim examples/five-slaves.plant.toml", program_invocation_name),
       StudioHost::has_pages() ? fmt::format("-- The same in the browser: {} demo --studio", program_invocation_name)
                               : std::string("-- The same in the browser: ./run pages, which builds Studio's pages")}};
}

int run_demo(const Options& options) {
  return bring_up(options, {"demo machine", "demo plant", demo_machine, demo_plant}, story());
}

}  // namespace

void add_demo(Verb& berth, Options& options) {
  const Verb demo = berth.add("demo", "the built-in machine: from blank devices to operational, then a replacement",
                              [&options] { return run_demo(options); });
  json_flag(demo, options);
  world_words(demo, options);
  const Word fast = drive_words(demo, options);
  studio_words(demo, options, fast);
  mqtt_words(demo, options, fast);
  demo.footer(
      "Examples:\n  berth demo\n  berth demo --fast --until replaced --json\n  berth demo --studio\n"
      "  berth demo --mqtt mqtt://localhost\n"
      "A machine of your own: berth help init, berth help up.");
}

}  // namespace berth::cli
