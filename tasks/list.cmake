# The tasks, in the order of tables: a row here and the file of the same name beside it are a task
# (docs/extending.md, "A task"). The six of the supplement come first.
set(DUET_TASKS
  hug
  handshake
  high_five
  wave
  bend
  fly_kiss
  fist_bump)
