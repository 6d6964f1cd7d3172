#include <ucontext.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "kernels/simt.hpp"

// ASan follows stacks: it has to be told of every switch.
#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/common_interface_defs.h>
#endif

namespace raceloc::gpu::emu {

namespace {

constexpr std::size_t kStack = std::size_t{256} * 1024;  // touched only as far as it is used
constexpr std::size_t kResidentBlocks = 3;

enum class State { ready, at_barrier, at_shuffle, finished };

struct Block;

/** A stack that is used over and over, by one kernel after the other: making one costs more than most kernels do. */
struct Fibre {
  Fibre();

  ucontext_t context{};
  std::unique_ptr<char[]> stack{new char[kStack]};
  Block* block = nullptr;
  Coordinates coordinates{};
  State state = State::ready;
  Place place{"", 0};
  double value = 0;  ///< brought to a shuffle, then taken from it
  int mask = 0;
};

struct Block {
  std::vector<std::unique_ptr<Fibre>> fibres;
  std::map<const void*, std::unique_ptr<std::byte[]>> shared;
  std::size_t finished = 0;
};

/** What ASan wants to know of a stack. */
struct Bounds {
  const void* bottom = nullptr;
  std::size_t size = 0;
};

class Launch {
 public:
  Launch(const char* name, simt::Grid grid, int threads, std::uint64_t seed,
         const std::function<void()>& kernel)
      : x_name(name), x_grid(grid), x_threads(threads), x_random(seed), x_kernel(kernel) {}

  void run();
  /** On a fibre: lets the scheduler go on; returns when it comes here again, in a later launch if this one is over. */
  static void yield();
  static void enter();
  [[nodiscard]] Fibre& current() { return *x_current; }

 private:
  void body();
  void start(Block& block, std::uint32_t number);
  void step(Fibre& fibre);
  void settle(Block& block, std::uint32_t warp);
  void releaseWarp(Block& block, std::size_t first, std::size_t last);
  [[noreturn]] void fail(const Fibre& at, const std::string& what) const;
  std::size_t draw(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(x_random); }

  std::string x_name;
  simt::Grid x_grid;
  int x_threads;
  std::mt19937_64 x_random;
  const std::function<void()>& x_kernel;
  std::vector<Fibre*> x_ready;
  ucontext_t x_scheduler{};
  Bounds x_scheduler_stack;
  Fibre* x_current = nullptr;
  std::exception_ptr x_thrown;
};

thread_local Launch* t_launch = nullptr;  // makecontext() passes no pointer
thread_local std::vector<std::unique_ptr<Fibre>> t_spare;

/** Where the thread came from to this stack, whose fake stack, kept when it was left, is `mine`. */
Bounds arrived([[maybe_unused]] void* mine) {
  Bounds from;
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_finish_switch_fiber(mine, &from.bottom, &from.size);
#endif
  return from;
}

Bounds switchTo(ucontext_t& from, ucontext_t& to, [[maybe_unused]] const Bounds& stack) {
  void* mine = nullptr;
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_start_switch_fiber(&mine, stack.bottom, stack.size);
#endif
  swapcontext(&from, &to);
  return arrived(mine);
}

Fibre::Fibre() {
  getcontext(&context);
  context.uc_stack.ss_sp = stack.get();
  context.uc_stack.ss_size = kStack;
  makecontext(&context, &Launch::enter, 0);
  context.uc_stack = {};  // or ASan's swapcontext() would unpoison all of it, each time
}

void Launch::yield() {
  const Bounds from =
      switchTo(t_launch->x_current->context, t_launch->x_scheduler, t_launch->x_scheduler_stack);
  t_launch->x_scheduler_stack = from;  // t_launch: not always the one of above
}

/** What a fibre does until it is deleted. */
void Launch::enter() {
  t_launch->x_scheduler_stack = arrived(nullptr);
  while (true) {
    t_launch->body();
    yield();
  }
}

void Launch::body() {
  try {
    x_kernel();
  } catch (...) {
    x_thrown = std::current_exception();
  }
  x_current->state = State::finished;
}

void Launch::start(Block& block, std::uint32_t number) {
  block = {};
  for (int t = 0; t < x_threads; ++t) {
    if (t_spare.empty()) t_spare.push_back(std::make_unique<Fibre>());
    auto fibre = std::move(t_spare.back());
    t_spare.pop_back();
    fibre->block = &block;
    fibre->state = State::ready;
    fibre->coordinates = {{number % x_grid.x, number / x_grid.x},
                          x_grid,
                          static_cast<std::uint32_t>(t),
                          static_cast<std::uint32_t>(x_threads)};
    x_ready.push_back(fibre.get());
    block.fibres.push_back(std::move(fibre));
  }
}

void Launch::run() {
  std::vector<std::uint32_t> waiting(static_cast<std::size_t>(x_grid.x) * x_grid.y);
  for (std::uint32_t b = 0; b < waiting.size(); ++b) waiting[b] = b;
  std::shuffle(waiting.begin(), waiting.end(), x_random);
  std::vector<Block> resident(std::min(kResidentBlocks, waiting.size()));
  for (Block& block : resident) {
    start(block, waiting.back());
    waiting.pop_back();
  }
  while (!x_ready.empty()) {
    std::swap(x_ready[draw(x_ready.size())], x_ready.back());
    Fibre& fibre = *x_ready.back();
    x_ready.pop_back();
    step(fibre);
    Block& block = *fibre.block;
    if (block.finished < block.fibres.size()) continue;
    for (auto& spare : block.fibres) t_spare.push_back(std::move(spare));
    block = {};
    if (waiting.empty()) continue;
    start(block, waiting.back());
    waiting.pop_back();
  }
}

void Launch::step(Fibre& fibre) {
  x_current = &fibre;
  switchTo(x_scheduler, fibre.context, {fibre.stack.get(), kStack});
  if (x_thrown) std::rethrow_exception(x_thrown);
  if (fibre.state == State::finished) ++fibre.block->finished;
  if (fibre.state == State::ready) {
    x_ready.push_back(&fibre);
  } else {
    settle(*fibre.block, fibre.coordinates.thread / simt::kWarp);
  }
}

bool same(const Place& a, const Place& b) {
  return a.line == b.line && (a.file == b.file || std::strcmp(a.file, b.file) == 0);  // == costs less
}

/** Lets a warp or the block go on if all of it waits at one place. */
void Launch::settle(Block& block, std::uint32_t warp) {
  const std::size_t first = static_cast<std::size_t>(warp) * simt::kWarp;
  const std::size_t last = std::min(block.fibres.size(), first + simt::kWarp);
  const auto together = [&](std::size_t begin, std::size_t end, State state) {
    const Fibre* leader = nullptr;
    std::size_t there = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const Fibre& f = *block.fibres[i];
      if (f.state == State::ready) return false;
      if (f.state != state) continue;
      if (leader != nullptr && !same(f.place, leader->place))
        fail(f, "threads wait at different places, the other at line " + std::to_string(leader->place.line));
      leader = &f;
      ++there;
    }
    if (there > 0 && there < end - begin) {
      fail(*leader, "only " + std::to_string(there) + " of " + std::to_string(end - begin) +
                        (state == State::at_barrier ? " threads of the block reach the barrier"
                                                    : " threads of the warp reach the shuffle"));
    }
    return there > 0;
  };
  if (together(first, last, State::at_shuffle)) {
    std::vector<double> brought;
    for (std::size_t i = first; i < last; ++i) brought.push_back(block.fibres[i]->value);
    for (std::size_t i = first; i < last; ++i) {
      const std::size_t from = (i - first) ^ static_cast<std::size_t>(block.fibres[i]->mask);
      if (from >= brought.size()) fail(*block.fibres[i], "the shuffle reads a lane that does not exist");
      block.fibres[i]->value = brought[from];
    }
    releaseWarp(block, first, last);
  } else if (together(0, block.fibres.size(), State::at_barrier)) {
    releaseWarp(block, 0, block.fibres.size());
  }
}

void Launch::releaseWarp(Block& block, std::size_t first, std::size_t last) {
  for (std::size_t i = first; i < last; ++i) {
    block.fibres[i]->state = State::ready;
    x_ready.push_back(block.fibres[i].get());
  }
}

/** The launch that fibres of this thread belong to, for a scope. */
class Current {
 public:
  explicit Current(Launch& launch) { t_launch = &launch; }
  ~Current() { t_launch = nullptr; }
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;
};

void Launch::fail(const Fibre& at, const std::string& what) const {
  throw KernelError(x_name + " at " + at.place.file + ":" + std::to_string(at.place.line) + ": " + what);
}

}  // namespace

void launch(const char* name, simt::Grid grid, int threads, std::uint64_t seed,
            const std::function<void()>& kernel) {
  Launch here(name, grid, threads, seed, kernel);
  const Current current(here);
  here.run();
}

const Coordinates& coordinates() { return t_launch->current().coordinates; }

void waitForBlock(Place place) {
  Fibre& me = t_launch->current();
  me.place = place;
  me.state = State::at_barrier;
  Launch::yield();
}

double exchange(double value, int mask, Place place) {
  Fibre& me = t_launch->current();
  me.place = place;
  me.value = value;
  me.mask = mask;
  me.state = State::at_shuffle;
  Launch::yield();
  return me.value;
}

void giveWay() { Launch::yield(); }

void* sharedMemory(const void* tag, std::size_t bytes) {
  auto& memory = t_launch->current().block->shared[tag];
  if (!memory) {
    memory.reset(new std::byte[bytes]);
    std::memset(memory.get(), 0xFF, bytes);  // NaN
  }
  return memory.get();
}

}  // namespace raceloc::gpu::emu
