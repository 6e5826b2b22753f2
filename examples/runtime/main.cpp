// The CANopen side of a controller whose program runs in another process: a device on a real port, made from its
// description and the plan of `berth link`, and its process image in shared memory. plc.c is the program, for a belt of
// examples/conveyor:
//
//     berth plant plant.toml -m machine.toml --listen /tmp/coal.sock      # without its "unloader"
//     berth up machine.toml --port plant:/tmp/coal.sock
//     example_runtime coal 9001 plant:/tmp/coal.sock field eds/controller.eds plan.toml unloader
//     example_runtime_plc coal
//
// Instead of EDS, plan and slot also a DCF alone, which has the network variables. Either process may be killed and be
// started anew: docs/process-image.md.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "berth/device/device.hpp"
#include "berth/eds/eds.hpp"
#include "berth/io/open_port.hpp"
#include "berth/linker/plan_file.hpp"
#include "berth/linker/process_variables.hpp"
#include "berth/process/device_image.hpp"
#include "berth/process/load.hpp"
#include "berth/process/shared_image.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

volatile std::sig_atomic_t ended = 0;

struct Wanted {
  std::string image;
  std::uint32_t serial = 0;
  std::string port;
  std::string bus;
  std::string file;  // EDS or DCF
  std::string plan;
  std::string slot;
};

int fail(const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  return 3;
}

/// What the program has: from the DCF, or from the EDS and the plan. Null: what is wrong was told.
std::optional<process::Program> load(const Wanted& wanted) {
  const auto read = eds::read_file(wanted.file);
  for (const auto& finding : read.findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  if (!read.usable()) return std::nullopt;
  std::vector<process::NetworkVariable> variables;
  if (!wanted.plan.empty()) {
    std::ifstream file(wanted.plan);
    std::ostringstream text;
    text << file.rdbuf();
    Findings findings;
    const auto plan = linker::read_plan(text.str(), wanted.plan, findings);
    for (const auto& finding : findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
    if (!plan) return std::nullopt;
    variables = linker::variables_of(*plan, wanted.slot);
    if (variables.empty()) {
      std::fprintf(stderr, "%s: it has no variables of slot \"%s\"\n", wanted.plan.c_str(), wanted.slot.c_str());
      return std::nullopt;
    }
  }
  auto program = process::load(read.file, variables);
  for (const auto& problem : program.problems) std::fprintf(stderr, "%s\n", problem.c_str());
  return program;
}

std::uint32_t default_of(const od::Description& description, ObjectRef object) {
  const auto* const sub = description.find(object);
  return sub == nullptr ? 0 : static_cast<std::uint32_t>(description.default_of(*sub).raw);
}

LssAddress address_of(const od::Description& description, std::uint32_t serial) {
  return {default_of(description, {0x1018, 1}), default_of(description, {0x1018, 2}),
          default_of(description, {0x1018, 3}), serial};
}

void tell(const process::DeviceImage::Reactions& reactions) {
  if (reactions.count == 0) return;
  const auto ms = [](rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); };
  std::printf(
      "from an RPDO to the TPDOs of what the program made of it: %llu times, %.2f to %.2f ms, %.2f ms on average\n",
      static_cast<unsigned long long>(reactions.count), ms(reactions.shortest), ms(reactions.longest),
      ms(reactions.sum) / static_cast<double>(reactions.count));
  std::fflush(stdout);
}

int run(const Wanted& wanted) {
  const auto program = load(wanted);
  if (!program) return 2;
  auto image = process::SharedImage::create(wanted.image, program->layout);
  if (!image) return fail(image.error());

  // In this order: the loop drives the executor, the port lives in the loop, the device on the port.
  rt::Executor executor;
  io::Loop loop(executor);
  const auto spec = can::parse_port(wanted.port);
  if (!spec) return fail(wanted.port + ": it is no port; \"socketcan:can0\" and \"plant:/tmp/plant.sock\" are");
  io::PortOptions options;
  options.bus = wanted.bus;
  const auto port = io::open_port(loop, *spec, options);
  if (!port) return fail(port.error());
  can::Dispatcher dispatcher(executor, **port);
  device::Device device(dispatcher, program->description, nullptr,
                        {.address = address_of(*program->description, wanted.serial)});
  process::DeviceImage link(device, executor, (*image)->network(), program->bound,
                            {.cycle = 1ms, .application_timeout = 200ms, .port = port->get()});
  for (const auto& problem : link.problems()) std::fprintf(stderr, "%s\n", problem.c_str());
  device.power_on();
  std::printf("image \"%s\": %zu variables; Ctrl-C ends it\n", wanted.image.c_str(),
              program->layout.variables().size());
  std::fflush(stdout);
  bool lost = false;
  auto next = executor.now() + 10s;
  while (ended == 0 && (*port)->status().up) {
    loop.turn(100ms);
    if (link.lost() != lost) {
      lost = link.lost();
      std::printf("%s\n", lost ? "the program is lost: its values are 0" : "the program is back");
      std::fflush(stdout);
    }
    if (executor.now() < next) continue;
    next += 10s;
    tell(link.reactions());
  }
  tell(link.reactions());
  if (ended == 0) return fail(wanted.port + ": the port has gone");
  return 0;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6 && count != 8) {
    std::fprintf(stderr, "usage: %s IMAGE SERIAL PORT BUS DCF | IMAGE SERIAL PORT BUS EDS PLAN SLOT\n", words[0]);
    return 2;
  }
  const auto end = [](int) { ended = 1; };
  std::signal(SIGINT, end);
  std::signal(SIGTERM, end);
  Wanted wanted;
  wanted.image = words[1];
  wanted.serial = static_cast<std::uint32_t>(std::strtoul(words[2], nullptr, 0));
  wanted.port = words[3];
  wanted.bus = words[4];
  wanted.file = words[5];
  if (count == 8) {
    wanted.plan = words[6];
    wanted.slot = words[7];
  }
  return run(wanted);
}
