#include "berth/io/seats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace berth::io {

Seat::Seat(Seats& seats, Sitter& sitter, std::string peer)
    : seats_(&seats), sitter_(&sitter), peer_(std::move(peer)), active_(seats.executor_->now()), begun_(active_) {
  seats_->seats_.push_back(this);
  arm();
}

Seat::~Seat() { leave(); }

void Seat::leave() noexcept {
  over_ = true;
  cancel();
  std::erase(seats_->seats_, this);
}

void Seat::whole_request() noexcept {
  if (over_) return;
  asked_ = true;
  active_ = seats_->executor_->now();
  begun_.reset();
}

// The start time of a request does not move when more of it arrives: a trickle of bytes is no request.
void Seat::begun(bool is) noexcept {
  if (over_ || (!asked_ && !is)) return;
  if (!is) return begun_.reset();
  if (!begun_) begun_ = seats_->executor_->now();
  arm();
}

void Seat::output(std::uint64_t taken, std::size_t waiting) noexcept {
  if (over_) return;
  const rt::Time now = seats_->executor_->now();
  const bool moved = std::exchange(taken_, taken) != taken;
  if (moved) active_ = now;
  if (waiting == 0) return stuck_.reset();
  if (moved || !stuck_) stuck_ = now;
  arm();
}

std::optional<rt::Time> Seat::deadline() const noexcept {
  const auto& rules = seats_->rules_;
  rt::Time first = rt::never;
  if (begun_) first = std::min(first, *begun_ + rules.patience);
  if (stuck_) first = std::min(first, *stuck_ + rules.untaken);
  return first == rt::never ? std::nullopt : std::optional(first);
}

// An alarm that comes too early sets itself again: deadlines mostly move away.
void Seat::arm() noexcept {
  const auto due = deadline();
  if (due && (!timed() || this->due() > *due)) seats_->executor_->at(*due, *this);
}

std::optional<Seat::End> Seat::overdue() const noexcept {
  const auto& rules = seats_->rules_;
  const rt::Time now = seats_->executor_->now();
  if (begun_ && now >= *begun_ + rules.patience) return asked_ ? End::unfinished : End::silent;
  if (stuck_ && now >= *stuck_ + rules.untaken) return End::untaken;
  return std::nullopt;
}

void Seat::run() noexcept {
  if (const auto end = overdue()) return lose(*end);
  arm();
}

void Seat::lose(End end) noexcept {
  leave();
  sitter_->seat_lost(end);
}

bool Seats::make_room(std::string_view peer) {
  const auto same = [&](const Seat* seat) { return seat->peer_ == peer; };
  const auto of_peer = static_cast<std::size_t>(std::ranges::count_if(seats_, same));
  const bool its_own = rules_.most_per_peer > 0 && of_peer >= rules_.most_per_peer;
  if (!its_own && seats_.size() < rules_.most) return true;
  Seat* idle = nullptr;
  for (Seat* const seat : seats_) {
    if (seat->sitter_->owed() || (its_own && !same(seat))) continue;
    if (idle == nullptr || seat->active_ < idle->active_) idle = seat;
  }
  if (idle == nullptr || executor_->now() - idle->active_ < rules_.idle) return false;
  idle->lose(Seat::End::displaced);
  return true;
}

std::string Seats::why(Seat::End end) const {
  const auto seconds = [](rt::Duration time) { return std::chrono::duration<double>(time).count(); };
  switch (end) {
    case Seat::End::silent: return fmt::format("no complete request in {} s", seconds(rules_.patience));
    case Seat::End::unfinished:
      return fmt::format("a request that was not complete after {} s", seconds(rules_.patience));
    case Seat::End::untaken: return fmt::format("did not read its answers for {} s", seconds(rules_.untaken));
    case Seat::End::displaced: break;
  }
  return "idle, and another client connected";
}

BoundedLines::BoundedLines(rt::Executor& executor, std::function<void(const std::string&)> tell)
    : executor_(&executor), tell_(std::move(tell)), refilled_(executor.now()) {}

void BoundedLines::operator()(const std::string& line) {
  if (!tell_) return;
  const auto fresh = (executor_->now() - refilled_) / pause;
  refilled_ += fresh * pause;
  left_ = static_cast<unsigned>(std::min<std::int64_t>(burst, left_ + fresh));
  if (left_ == 0) {
    ++left_out_;
    return;
  }
  --left_;
  if (left_out_ > 0) tell_(fmt::format("{} lines about connections were left out", std::exchange(left_out_, 0)));
  tell_(line);
}

std::string_view without_port(std::string_view peer) noexcept { return peer.substr(0, peer.rfind(':')); }

}  // namespace berth::io
