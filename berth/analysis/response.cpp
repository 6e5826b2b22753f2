#include "berth/analysis/response.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/can/frame.hpp"
#include "berth/can/length.hpp"

namespace berth::analysis {
namespace {

using Ns = std::int64_t;

constexpr Ns no_bound = -1;
constexpr unsigned error_bits = 31;  // error flags, delimiter, intermission, and the pause of an error-passive node

constexpr Ns ceil_div(Ns a, Ns b) noexcept { return a <= 0 ? 0 : (a + b - 1) / b; }

// One message, in numbers.
struct Task {
  std::uint32_t key;
  std::size_t sender;
  Ns c;         // frame
  Ns t;         // period
  Ns j;         // jitter
  Ns f = 0;     // waits so long in a FIFO before arbitration sees it, at most
  Ns queued{};  // bound from the queue to the end of the frame
  Ns worst{};   // and from the event
};

class Analyzer {
 public:
  explicit Analyzer(const Line& line) : line_(line), bit_(ceil_div(1'000'000'000, line.bit_rate)) {
    for (const Message& m : line.messages) {
      const bool extended = (m.key & can::extended_flag) != 0;
      tasks_.push_back({.key = m.key,
                        .sender = m.sender,
                        .c = frame_time(line, extended, m.data_bytes).count(),
                        .t = m.period.count(),
                        .j = m.jitter.count()});
      longest_ = std::max(longest_, 100 * (m.period + m.jitter).count());
    }
  }

  // What waits in FIFOs makes others later, and so waits longer: from below to the least that fits together.
  void run() {
    for (bool again = true; again;) {
      again = false;
      for (Task& task : tasks_) bound(task);
      for (Task& task : tasks_) {
        if (!line_.senders[task.sender].fifo) continue;
        const Ns f = task.queued == no_bound ? longest_ : task.queued - task.c;
        again = again || f > task.f;
        task.f = std::max(task.f, f);
      }
    }
  }
  [[nodiscard]] const std::vector<Task>& tasks() const noexcept { return tasks_; }

 private:
  // The frames that leave in one order: those of a FIFO, or this message alone.
  struct Queue {
    std::vector<const Task*> own;
    std::vector<const Task*> before;  // of others, that win against the lowest of `own`
    Ns blocking = 0;
    Ns resent = 0;  // the longest frame that an error can destroy
  };

  [[nodiscard]] Queue queue_of(const Task& task) const {
    Queue queue;
    const bool fifo = line_.senders[task.sender].fifo;
    std::uint32_t lowest = task.key;
    for (const Task& each : tasks_) {
      const bool own = &each == &task || (fifo && each.sender == task.sender);
      if (!own) continue;
      queue.own.push_back(&each);
      if (precedes(lowest, each.key)) lowest = each.key;
    }
    if (line_.background_bytes)
      queue.blocking = frame_time(line_, line_.background_extended, *line_.background_bytes).count();
    for (const Task& each : tasks_) {
      if (std::ranges::find(queue.own, &each) != queue.own.end()) {
        queue.resent = std::max(queue.resent, each.c);
      } else if (precedes(each.key, lowest) || each.key == lowest) {
        queue.before.push_back(&each);
        queue.resent = std::max(queue.resent, each.c);
      } else {
        queue.blocking = std::max(queue.blocking, each.c);
      }
    }
    return queue;
  }

  [[nodiscard]] Ns errors_in(Ns time, const Queue& queue) const noexcept {
    const Ns interval = line_.errors.interval.count();
    if (interval <= 0) return 0;
    const Ns burst = std::max(1U, line_.errors.burst);
    return (burst - 1 + ceil_div(time, interval)) * (error_bits * bit_ + queue.resent);
  }

  [[nodiscard]] static Ns of_others(Ns time, const Queue& queue) noexcept {
    Ns sum = 0;
    for (const Task* k : queue.before) sum += ceil_div(time + k->j + k->f, k->t) * k->c;
    return sum;
  }

  // The frames that can be queued in a window that begins with all of them, up to and at `x`.
  [[nodiscard]] static Ns own_until(Ns x, const Queue& queue) noexcept {
    Ns sum = 0;
    for (const Task* i : queue.own) sum += ((x + i->j) / i->t + 1) * i->c;
    return sum;
  }

  // The longest time in which the bus has work of this priority without a pause.
  [[nodiscard]] Ns busy_period(const Queue& queue) const noexcept {
    Ns length = queue.blocking + 1;
    while (length <= longest_) {
      Ns next = queue.blocking + of_others(length, queue) + errors_in(length, queue);
      for (const Task* i : queue.own) next += ceil_div(length + i->j, i->t) * i->c;
      if (next <= length) return length;
      length = next;
    }
    return no_bound;
  }

  // From the window's begin to the start of the last frame that was queued up to `x`.
  [[nodiscard]] Ns start_of_last(Ns work, Ns last, const Queue& queue) const noexcept {
    Ns start = queue.blocking + work - last;
    while (start <= longest_) {
      const Ns next = queue.blocking + work - last + of_others(start + bit_, queue) + errors_in(start + last, queue);
      if (next <= start) return start;
      start = next;
    }
    return no_bound;
  }

  // The instants at which one more frame can be in the queue, ascending.
  [[nodiscard]] static std::vector<Ns> instants(Ns end, const Queue& queue) {
    std::vector<Ns> result{0};
    for (const Task* i : queue.own) {
      for (Ns n = i->j / i->t + 1; n * i->t - i->j < end; ++n) result.push_back(n * i->t - i->j);
    }
    std::ranges::sort(result);
    const auto [first, last] = std::ranges::unique(result);
    result.erase(first, last);
    return result;
  }

  void bound(Task& task) const {
    const Queue queue = queue_of(task);
    const Ns end = busy_period(queue);
    task.queued = task.worst = end == no_bound ? no_bound : 0;
    if (end == no_bound) return;
    for (const Ns x : instants(end, queue)) {
      const Ns start = start_of_last(own_until(x, queue), task.c, queue);
      if (start == no_bound) {
        task.queued = task.worst = no_bound;
        return;
      }
      // The event of the frame that is queued at x: its jitter before x at most, and a period behind the one before.
      // With a jitter of a period and more they may have overtaken each other.
      const Ns in_order = std::max((x + task.j) / task.t * task.t, x) - task.j;
      const Ns event = task.j >= task.t ? x - task.j : in_order;
      task.queued = std::max(task.queued, start + task.c - x);
      task.worst = std::max(task.worst, start + task.c - event);
    }
  }

  const Line& line_;
  Ns bit_;
  Ns longest_ = 0;
  std::vector<Task> tasks_;
};

}  // namespace

std::string key_text(std::uint32_t key) {
  const bool extended = (key & can::extended_flag) != 0;
  return extended ? fmt::format("{:08X}h", key & ~can::extended_flag) : fmt::format("{:03X}h", key);
}

bool Result::good() const noexcept {
  return std::ranges::all_of(responses, [](const Response& r) { return r.worst && r.meets_deadline; });
}

std::string wrong(const Line& line) {
  if (line.bit_rate == 0) return "the bus has no bit rate";
  if (line.background_bytes.value_or(0) > 8) return "a frame has 8 bytes of data at most";
  if (line.errors.interval.count() < 0) return "the time between errors is negative";
  for (const Message& m : line.messages) {
    const char* why = nullptr;
    if (m.sender >= line.senders.size()) why = "its sender is not there";
    if (m.data_bytes > 8) why = "a frame has 8 bytes of data at most";
    if (m.period.count() <= 0) why = "it has no period";
    if (m.jitter.count() < 0 || m.deadline.count() < 0) why = "a time is negative";
    if (why != nullptr) return fmt::format("{}: {}", m.name, why);
  }
  return {};
}

Result analyze(const Line& line) {
  Analyzer analyzer(line);
  analyzer.run();
  Result result;
  for (std::size_t i = 0; i < line.messages.size(); ++i) {
    const Task& task = analyzer.tasks()[i];
    Response r{.message = i, .frame = rt::Duration(task.c)};
    r.load = static_cast<double>(task.c) / static_cast<double>(task.t);
    if (task.worst != no_bound) r.worst = rt::Duration(task.worst);
    const rt::Duration deadline = line.messages[i].deadline;
    r.meets_deadline = r.worst && (deadline.count() == 0 || *r.worst <= deadline);
    result.load += r.load;
    result.responses.push_back(r);
  }
  return result;
}

rt::Duration frame_time(const Line& line, bool extended, unsigned data_bytes) noexcept {
  const bool usual = line.lengths == FrameLengths::usual;
  const Ns bits = usual ? can::worst_case_bits(extended, data_bytes) : can::reachable_most_bits(extended, data_bytes);
  return rt::Duration(ceil_div(bits * 1'000'000'000, line.bit_rate));
}

bool precedes(std::uint32_t a, std::uint32_t b) noexcept {
  const auto base = [](std::uint32_t key) {
    const bool extended = (key & can::extended_flag) != 0;
    return extended ? (key & ~can::extended_flag) >> 18U : key;
  };
  const bool a_extended = (a & can::extended_flag) != 0;
  const bool b_extended = (b & can::extended_flag) != 0;
  if (base(a) != base(b)) return base(a) < base(b);
  if (a_extended != b_extended) return b_extended;
  return a < b;
}

}  // namespace berth::analysis
