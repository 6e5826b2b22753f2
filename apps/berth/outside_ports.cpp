#include "outside_ports.hpp"

#include <fmt/format.h>

#include "berth/io/open_port.hpp"
#include "berth/live/reopening_port.hpp"

namespace berth::cli {

tl::expected<std::unique_ptr<can::Port>, Failure> OutsidePorts::open_one(const design::Bus& bus) {
  io::PortOptions wanted;
  wanted.bit_rate = rate_as_it_stands_ ? 0 : bus.bitrate;
  wanted.listen_only = bus.role == design::Role::observer;
  wanted.bus = bus.name;
  auto port = io::open_port(loop_, bus.port, wanted);
  if (!port) return tl::unexpected(failure(Exit::failed, fmt::format("bus {}: {}", bus.name, port.error())));
  const auto rate = (*port)->status().bit_rate;
  if (rate == bus.bitrate || rate == 0 || rate_as_it_stands_) return std::move(*port);
  return tl::unexpected(
      failure(Exit::failed, fmt::format("{}:{}: bus {} is configured for {} bit/s, but {} runs at {}", file_,
                                        bus.place.line, bus.name, bus.bitrate, can::to_string(bus.port), rate)));
}

// Opens the port again after it is lost; the other kinds of ports do that themselves.
std::unique_ptr<can::Port> OutsidePorts::reopening(const design::Bus& bus, std::unique_ptr<can::Port> port) {
  const auto open = [this, &bus]() -> std::unique_ptr<can::Port> {
    auto again = open_one(bus);
    return again ? std::move(*again) : nullptr;
  };
  return std::make_unique<live::ReopeningPort>(executor_, std::move(port), open);
}

tl::expected<can::Port*, Failure> OutsidePorts::open(const design::Bus& bus, const Options& options) {
  if (is_real(bus.port) && bus.role != design::Role::observer && !options.outside.observe) {
    auto lock = PortLock::take(bus.port);
    if (!lock) return tl::unexpected(lock.error());
    locks_.push_back(std::move(*lock));
  }
  auto port = open_one(bus);
  if (!port) return tl::unexpected(port.error());
  raw_.push_back(bus.port.kind == can::PortKind::plant ? reopening(bus, std::move(*port)) : std::move(*port));
  return raw_.back().get();
}

}  // namespace berth::cli
