!> A scene on standard input, as bench/stability/multipliers.py writes it; its motion on standard output.
program chain_with_multipliers
   use scene_data, only: scene_type, read_scene
   use chain_motion, only: run
   implicit none (type, external)
   type(scene_type) :: scene
   call read_scene(scene)
   call run(scene)
end program chain_with_multipliers
